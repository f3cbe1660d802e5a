"""mink: tip as a task, RCM as hard rows."""

from importlib.metadata import version

import mink
import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.bench.libraries.problem import Circle
from surgsim.control.mink_tasks import RcmTask


class Mink:
    """`solve_ik` with daqp, as in mink's examples."""

    name = "mink"
    how = "daqp; tip a task, RCM hard rows, limits of position and speed"

    def __init__(self, circle: Circle) -> None:
        self.version = version("mink")
        model, limits = circle.arm.scene.model, circle.arm.limits
        self._dt, self._site = circle.dt_s, circle.arm.scene.tip_site
        self._configuration = mink.Configuration(model)
        self._tip = mink.FrameTask("tip", "site", position_cost=1.0, orientation_cost=0.0)
        self._rcm = RcmTask(self._site, model.nv)
        self._rcm.target = circle.p_WC
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) for i in range(model.njnt)]
        speeds = dict(zip(names, limits.velocity.tolist(), strict=True))
        self._limits = [mink.VelocityLimit(model, speeds), mink.ConfigurationLimit(model)]

    def tip(self, q: Array) -> Array:
        """See `Library`."""
        self._configuration.update(q)
        return np.array(self._configuration.data.site_xpos[self._site])

    def start(self, q: Array) -> None:
        """See `Library`."""
        self._configuration.update(q)

    def step(self, target: Array) -> Array:
        """See `Library`."""
        self._tip.set_target(mink.SE3.from_translation(target))
        velocity = mink.solve_ik(
            self._configuration,
            [self._tip],
            self._dt,
            "daqp",
            damping=1e-9,
            limits=self._limits,
            constraints=[self._rcm],
        )
        self._configuration.integrate_inplace(velocity, self._dt)
        return np.array(self._configuration.q)
