"""The controller's knowledge of the arm: kinematics and dynamics of the nominal model.

A controller never sees the plant's data. It evaluates its own copy of the robot and instrument, without
the payload, friction or inertia errors that a scenario gives the plant.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.build import JointLimits, Scene, build_arm
from surgsim.models.config import SceneConfig
from surgsim.models.drive import Drive
from surgsim.spatial import cross
from surgsim.tick.arrays import Model

RCM_ROWS = 2
"""Rows that hold the shaft in a trocar."""
_ALONG = 1e-9  # m, rad


@dataclass(frozen=True, slots=True, kw_only=True)
class Kinematics:
    """First-order kinematics of tip and shaft at one configuration, in the world frame.

    Attributes:
        p_WT: Tip position (3,) [m].
        R_WT: Tip orientation (3, 3); its third column is the shaft axis, away from the adapter.
        Jv_WT: Translational tip Jacobian (3, n) [m/rad].
        Jw_WT: Rotational tip Jacobian (3, n) [-].
        p_WS: Position of the shaft's end (3,) [m]: the tip of a straight instrument.
        Jv_WS: Its translational Jacobian (3, n) [m/rad].
        z_W: Joint axes as rows (n, 3), unit.
        anchors_W: Points on the joint axes as rows (n, 3) [m].
    """

    p_WT: Array
    R_WT: Array
    Jv_WT: Array
    Jw_WT: Array
    p_WS: Array
    Jv_WS: Array
    z_W: Array
    anchors_W: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Dynamics:
    """Rigid-body dynamics at one state: M q'' + bias = tau - damping * v.

    Attributes:
        mass_matrix: Joint-space inertia with armature (n, n) [kg m^2].
        bias: Coriolis, centrifugal and gravity torque (n,) [N m].
    """

    mass_matrix: Array
    bias: Array


class ArmModel:
    """Nominal robot with its instrument; evaluates `Kinematics` and `Dynamics` anywhere.

    Evaluations share one scratch `MjData`, so an instance belongs to one thread.
    """

    def __init__(self, config: SceneConfig) -> None:
        self._scene: Scene = build_arm(config)
        self._model = self._scene.model
        self._data = mujoco.MjData(self._model)
        data, site = self._data, self._scene.tip_site
        self._tip, self._rotation = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
        self._axes, self._anchors = data.xaxis, data.xanchor
        self._held: list[mujoco.MjData] = []
        drives = config.robot.drives
        self._drive = None if drives is None else drives.values(self._model.nv)

    @property
    def scene(self) -> Scene:
        """The compiled nominal scene."""
        return self._scene

    @property
    def limits(self) -> JointLimits:
        """Joint position, velocity, acceleration and torque limits."""
        return self._scene.limits

    @property
    def damping(self) -> Array:
        """Viscous joint damping of the nominal model (n,) [N m s/rad]."""
        return np.array(self._model.dof_damping, dtype=float)

    @property
    def drive(self) -> Drive | None:
        """What is known of the joints' drives; None where they are ideal."""
        return self._drive

    @property
    def locked_frequency(self) -> float:
        """The lowest sqrt(K / B_s) of its drives [rad/s], a motor on its gear; infinite if they are ideal."""
        if self._drive is None:
            return math.inf
        return float(np.sqrt(self._drive.stiffness / self._drive.apparent_inertia).min())

    @cached_property
    def rolls_shaft(self) -> bool:
        """Whether the last joint turns about the shaft, and so moves neither tip nor shaft axis."""
        kin = self.kinematics(0.5 * (self.limits.q_min + self.limits.q_max))
        turned = cross(kin.z_W[-1], kin.R_WT[:, 2])
        return bool(np.abs(turned).max() < _ALONG and np.abs(kin.Jv_WT[:, -1]).max() < _ALONG)

    @property
    def is_angled(self) -> bool:
        """Whether the tip is not the shaft's end."""
        return self._scene.is_angled

    @cached_property
    def p_TS(self) -> Array:
        """The shaft's end in the tip's frame (3,) [m]; zeros of a straight instrument."""
        if not self.is_angled:
            return np.zeros(3)
        tip, turn, _, end = self._sites
        p: Array = turn.T @ (end - tip)
        return p

    @cached_property
    def p_TA(self) -> Array:
        """The shaft's entry in the tip's frame (3,) [m]."""
        _, _, entry, end = self._sites
        return self.p_TS - [0.0, 0.0, float(np.linalg.norm(end - entry))]

    @cached_property
    def _sites(self) -> tuple[Array, Array, Array, Array]:
        """Place (3,) [m] and turn (3, 3) of the tip, entry and end of the shaft (3,) [m], in some posture."""
        scene, data = self._scene, mujoco.MjData(self._model)
        data.qpos[:] = self.limits.q_min
        mujoco.mj_kinematics(self._model, data)
        tip, entry, end = scene.tip_site, scene.shaft_entry_site, scene.shaft_end_site
        x = data.site_xpos
        return x[tip].copy(), data.site_xmat[tip].reshape(3, 3).copy(), x[entry].copy(), x[end].copy()

    def redundancy(self, has_trocar: bool) -> int:
        """Degrees of freedom that are left when the tip, and with a trocar the shaft, are held.

        That is n - 3, two fewer with a trocar, and one fewer where the last joint rolls the shaft: the roll
        is not counted, since it moves neither.
        """
        return int(self._model.nv) - 3 - RCM_ROWS * has_trocar - self.rolls_shaft

    def point(self, record: Model, *, shared: bool = False) -> mujoco.MjData:
        """Let a record evaluate this arm, with data of its own or `shared` ones; the data.

        This object must outlive the record. Shared data are those of this object's own evaluations.
        """
        model, site = self._model, self._scene.tip_site
        data = self._data if shared else mujoco.MjData(model)
        if not shared:
            self._held.append(data)
        record.mj_model, record.mj_data, record.site = model._address, data._address, site
        record.qpos, record.qvel = data.qpos.ctypes.data, data.qvel.ctypes.data
        record.site_xpos, record.site_xmat = (
            data.site_xpos[site].ctypes.data,
            data.site_xmat[site].ctypes.data,
        )
        record.xaxis, record.xanchor = data.xaxis.ctypes.data, data.xanchor.ctypes.data
        record.xpos, record.xmat, record.nbody = data.xpos.ctypes.data, data.xmat.ctypes.data, model.nbody
        record.damping[:] = self.damping
        record.angled, record.p_TS[:] = self.is_angled, self.p_TS
        return data

    def kinematics(self, q: Array) -> Kinematics:
        """Kinematics at joint positions `q` (n,) [rad]."""
        self._place(q)
        return self._read_kinematics()

    def dynamics(self, q: Array, v: Array) -> Dynamics:
        """Dynamics at joint positions `q` (n,) [rad] and velocities `v` (n,) [rad/s]."""
        self._place(q)
        return self._read_dynamics(v)

    def evaluate(self, q: Array, v: Array) -> tuple[Kinematics, Dynamics]:
        """Both at once, for one placement of the model."""
        self._place(q)
        return self._read_kinematics(), self._read_dynamics(v)

    def _place(self, q: Array) -> None:
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def _read_kinematics(self) -> Kinematics:
        n = self._model.nv
        Jv, Jw = np.empty((3, n)), np.empty((3, n))
        mujoco.mj_jacSite(self._model, self._data, Jv, Jw, self._scene.tip_site)
        end, Jv_end = self._scene.shaft_end_site, Jv
        if self.is_angled:
            Jv_end = np.empty((3, n))
            mujoco.mj_jacSite(self._model, self._data, Jv_end, None, end)
        return Kinematics(
            p_WT=self._tip.copy(),
            R_WT=self._rotation.copy(),
            Jv_WT=Jv,
            Jw_WT=Jw,
            p_WS=self._data.site_xpos[end].copy(),
            Jv_WS=Jv_end,
            z_W=self._axes.copy(),
            anchors_W=self._anchors.copy(),
        )

    def _read_dynamics(self, v: Array) -> Dynamics:
        model, data, n = self._model, self._data, self._model.nv
        bias, M = np.empty(n), np.empty((n, n))
        data.qvel[:] = v
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, bias)
        mujoco.mj_makeM(model, data)
        mujoco.mj_fullM(model, data, M)
        return Dynamics(mass_matrix=M, bias=bias)
