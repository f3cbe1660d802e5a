"""An arm held at joint positions with its shaft in a port that it was put around."""

from collections.abc import Callable
from dataclasses import dataclass, field

import mujoco
import numpy as np
import pytest
from port_alone import Port

from surgsim.models.build import Scene, build, build_arm
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig, WallConfig
from surgsim.plant.ledger import EnergyLedger, after_step, before_step, fill_terms
from surgsim.plant.records import world_of

Q = np.array([1.6, -0.4, 0.2, 1.5, 0.1, -1.0, 0.3])
DEPTH_M = 0.18  # of the tip below the port


class Books:
    """An energy ledger outside a plant: its kernels on arrays of its own."""

    def __init__(self, scene: Scene, data: mujoco.MjData, port: Port | None = None) -> None:
        self.ledger = EnergyLedger(scene, data, None if port is None else port.bore)
        self.world = world_of(scene, data, float(scene.model.opt.timestep))
        self.values = np.zeros(len(EnergyLedger.COLUMNS))

    def start(self) -> None:
        self.ledger.memory[:] = 0.0

    def _call(self, kernel: Callable[..., int]) -> None:
        assert kernel(self.ledger.gains, self.world, self.ledger.memory, self.values) == 0

    def before_step(self) -> None:
        self._call(before_step)

    def after_step(self) -> None:
        self._call(after_step)

    def terms(self) -> np.ndarray:
        self._call(fill_terms)
        return self.values.copy()


@dataclass
class Rig:
    """MuJoCo's plain loop around a `Port` and its ledger."""

    scene: Scene
    data: mujoco.MjData
    port: Port
    ledger: Books
    q: np.ndarray
    stiffness: float = 400.0
    damping: float = 20.0
    torque: Callable[[float], np.ndarray] = lambda t: np.zeros(7)
    push: Callable[[float], np.ndarray] = lambda t: np.zeros(3)  # on the shaft, at the port
    rest: Callable[[float], tuple[np.ndarray, np.ndarray]] = lambda t: (np.zeros(3), np.zeros(3))
    log: list[tuple[float, ...]] = field(default_factory=list)

    def reset(self, q: np.ndarray | None = None, cannula: tuple[float, ...] = (0.0, 0.0, 0.0)) -> None:
        mujoco.mj_resetData(self.scene.model, self.data)
        self.data.qpos[self.scene.qpos_ids] = self.q if q is None else q
        if self.scene.wall is not None:
            self.data.qpos[self.scene.cannula_qpos_ids] = cannula
        self.port.reset()
        self._settle(0.0)
        self.ledger.start()

    def _settle(self, t: float) -> None:
        self.data.qfrc_applied[:] = 0.0
        self.data.xfrc_applied[:] = 0.0
        self.port.move(*self.rest(t))
        mujoco.mj_step1(self.scene.model, self.data)

    def step(self) -> None:
        model, data, ids = self.scene.model, self.data, self.scene.dof_ids
        hold = self.stiffness * (self.q - data.qpos[self.scene.qpos_ids]) - self.damping * data.qvel[ids]
        data.ctrl[:] = data.qfrc_bias[ids] + hold + self.torque(data.time)
        force = self.push(data.time)
        if force.any():
            body = model.body("instrument").id
            at = data.site_xpos[self.scene.trocar_site]
            mujoco.mj_applyFT(model, data, force, np.zeros(3), at, body, data.qfrc_applied)
        self.port.act()
        self.ledger.before_step()
        mujoco.mj_step2(model, data)
        self.ledger.after_step()
        self._settle(data.time)

    def run(self, duration_s: float, look: Callable[[], object] | None = None) -> list[object]:
        seen = []
        for _ in range(round(duration_s / self.scene.model.opt.timestep)):
            self.step()
            if look is not None:
                seen.append(look())
        return seen

    def term(self, name: str) -> float:
        return float(self.ledger.terms()[EnergyLedger.COLUMNS.index(name)])

    def books(self, port: Port | None = None) -> Books:
        """Another ledger of the same mechanism; without the port it knows nothing of the bore."""
        return Books(self.scene, self.data, port)

    def axes(self) -> np.ndarray:
        """Columns x, y, z of the port's frame."""
        return self.data.site_xmat[self.scene.trocar_site].reshape(3, 3).copy()

    def shaft_axis(self) -> np.ndarray:
        """Unit vector (3,) from entry to tip."""
        entry, tip = (self.data.site_xpos[i] for i in (self.scene.shaft_entry_site, self.scene.tip_site))
        return (tip - entry) / np.linalg.norm(tip - entry)

    def shaft(self) -> tuple[np.ndarray, float]:
        """Vector from the shaft's axis to the cannula (3,), and the cannula's distance from the entry."""
        u, entry = self.shaft_axis(), self.data.site_xpos[self.scene.shaft_entry_site]
        away = self.port.position() - entry
        return away - u * (u @ away), float(u @ away)


@pytest.fixture(scope="session")
def rig() -> Callable[..., Rig]:
    """Factory: `rig(timestep_s=..., ideal=..., robot=..., offset=..., <wall keys>)`, reset and ready."""

    def make(
        timestep_s: float = 0.001,
        *,
        ideal: bool = False,
        robot: str = "lwr4plus",
        offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        **wall: float,
    ) -> Rig:
        arm = SceneConfig(robot=RobotConfig(name=robot), timestep_s=timestep_s)
        nominal = build_arm(arm)
        data = mujoco.MjData(nominal.model)
        q = Q if robot == "lwr4plus" else np.array([1.6, -0.4, 0.2, -2.0, 0.1, 1.7, 0.3])
        data.qpos[:] = q
        mujoco.mj_forward(nominal.model, data)
        down = data.site_xmat[nominal.tip_site].reshape(3, 3)
        centre = data.site_xpos[nominal.tip_site] - DEPTH_M * down[:, 2] + down @ offset_m
        trocar = TrocarConfig(
            position_m=tuple(centre.tolist()),
            axis=tuple((-down[:, 2]).tolist()),
            wall=None if ideal else WallConfig(**wall),
        )
        scene = build(arm.model_copy(update={"trocar": trocar, "theatre": False}), drawn=False)
        state = mujoco.MjData(scene.model)
        port = Port(scene, state)
        made = Rig(scene, state, port, Books(scene, state, port), q)
        made.reset()
        return made

    return make
