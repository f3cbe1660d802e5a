"""Jaws that hold a ring: a constraint in place of the jaws' mechanics.

Closing past `close_at`, the jaws catch the nearest ring if the tip is within `capture_distance_m` of its
rim's surface. A soft weld then keeps the ring's pose relative to the jaws as it is, so that no energy comes
in. The ring slips out in the first step in which the weld's force (its three linear components) exceeds

    F_max = grip_force_n * jaw,

and is let go when the jaws open below `open_at`. What energy the weld holds then is lost. Jaws that closed
on nothing, or lost a ring, must open before they catch again. Held, a ring does not touch the jaws' contact
sphere, nor after that before it has left it.

A weld of MuJoCo's and not a spring written by hand: it is solved together with the contacts, so it is stiff
at a ring of 3 g without a smaller timestep. Its force is not known before a step is done: the limit acts one
step late.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.models.build import Scene
from surgsim.models.peg_board import PegBoardLayout
from surgsim.plant.props.base import TIP_CONTACT_BIT, TIP_GEOM
from surgsim.plant.props.peg_scene import hold_name, ring_name

Array = NDArray[np.float64]
_POSE = 10  # numbers of a weld's data that say where


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspLaw:
    """Numbers of the grasp; see the module's text."""

    close_at: float
    open_at: float
    capture_distance_m: float
    grip_force_n: float


class Grasp:
    """The jaws' hold on at most one ring.

    The welds' poses and the rings' contact bits are kept in the model, which belongs to the plant: a new
    `Grasp` on a used model starts by letting all rings go.

    Attributes:
        held: The ring in the jaws, or None.
    """

    def __init__(self, scene: Scene, data: mujoco.MjData, layout: PegBoardLayout, law: GraspLaw) -> None:
        model = self._model = scene.model
        self._data, self._law = data, law
        self._R, self._r = layout.ring_radius_m, layout.rim_radius_m
        count = range(len(layout.source_m))
        self._jaws = model.body("jaws").id
        self._bodies = [model.body(ring_name(ring)).id for ring in count]
        self._welds = [model.equality(hold_name(ring)).id for ring in count]
        self._forces = [self._sensor(hold_name(ring)) for ring in count]
        self._load = self._sensor("jaws_load")
        self._tip_radius = float(model.geom(TIP_GEOM).size[0])
        self.held: int | None = None
        self._leaving: int | None = None
        self._ready = True
        for ring in count:
            self._touch(ring, touching=True)

    def act(self, jaw: float) -> int | None:
        """Catch, let slip or let go, the jaws closed by `jaw`; returns the ring that slipped, if any."""
        law, slipped = self._law, None
        if self._leaving is not None and self._tip_gap(self._leaving) > 0.0:
            self._touch(self._leaving, touching=True)
            self._leaving = None
        if self.held is not None and jaw < law.open_at:
            self._let_go()
        elif self.held is not None and self.hold_force() > law.grip_force_n * jaw:
            slipped = self.held
            self._let_go()
        if jaw < law.open_at:
            self._ready = True
        elif jaw >= law.close_at and self._ready:
            self._ready = False
            self._catch()
        return slipped

    def hold_force(self) -> float:
        """Force of the jaws on the ring in them over the last step [N]."""
        return 0.0 if self.held is None else _norm(self._forces[self.held])

    def load(self) -> float:
        """Force of everything on the jaws over the last step [N]: rings in them, contact with the rest."""
        return _norm(self._load)

    def _catch(self) -> None:
        gaps = [self._gap(ring, self._data.xpos[self._jaws]) for ring in range(len(self._bodies))]
        ring = int(np.argmin(gaps))
        if gaps[ring] > self._law.capture_distance_m:
            return
        if self._leaving is not None:
            self._touch(self._leaving, touching=True)
            self._leaving = None
        weld, data = self._welds[ring], self._data
        self._model.eq_data[weld, :_POSE] = self._relative_pose(ring)
        data.eq_active[weld] = 1
        self._touch(ring, touching=False)
        self.held = ring

    def _let_go(self) -> None:
        assert self.held is not None
        self._data.eq_active[self._welds[self.held]] = 0
        self._leaving, self.held = self.held, None

    def _relative_pose(self, ring: int) -> Array:
        """The ring's place in the jaws as a weld's data (10,).

        The tip in the ring's frame, the tip in the jaws', and the ring's orientation in the jaws' (wxyz).
        """
        data, jaws, body = self._data, self._jaws, self._bodies[ring]
        arm = data.xmat[body].reshape(3, 3).T @ (data.xpos[jaws] - data.xpos[body])
        inverse, turn = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(inverse, data.xquat[jaws])
        mujoco.mju_mulQuat(turn, inverse, data.xquat[body])
        return np.array([*arm, 0.0, 0.0, 0.0, *turn])

    def _gap(self, ring: int, point: Array) -> float:
        """Distance [m] of a point (3,) from the surface of a ring: of a circle, less the rim's radius."""
        body = self._bodies[ring]
        x, y, z = self._data.xmat[body].reshape(3, 3).T @ (point - self._data.xpos[body])
        return float(np.hypot(np.hypot(x, y) - self._R, z)) - self._r

    def _tip_gap(self, ring: int) -> float:
        """Room between the jaws' contact sphere and a ring [m]."""
        axis = self._data.xmat[self._jaws].reshape(3, 3)[:, 2]
        centre = self._data.xpos[self._jaws] - self._tip_radius * axis
        return self._gap(ring, centre) - self._tip_radius

    def _touch(self, ring: int, *, touching: bool) -> None:
        """Whether a ring's rim touches the jaws' contact sphere."""
        model, body = self._model, self._bodies[ring]
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        for geom in range(first, first + count):
            if model.geom_conaffinity[geom]:
                bits = int(model.geom_conaffinity[geom])
                model.geom_conaffinity[geom] = bits | TIP_CONTACT_BIT if touching else bits & ~TIP_CONTACT_BIT

    def _sensor(self, name: str) -> Array:
        first = int(self._model.sensor(name).adr[0])
        force: Array = self._data.sensordata[first : first + 3]
        return force


def _norm(force: Array) -> float:
    return math.hypot(*force.tolist())
