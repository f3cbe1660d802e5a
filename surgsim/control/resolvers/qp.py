"""QP: inverse kinematics as a convex program with the RCM as a hard constraint."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.control.failure import ControlFailure
from surgsim.control.manipulability import log_manipulability_gradient
from surgsim.control.planes import PlaneConfig, Planes
from surgsim.control.problem import (
    Resolution,
    VelocityProblem,
    bounded_resolution,
    braking_bounds,
    stacked_rows,
)
from surgsim.control.qp import SHIPPED, DenseQp
from surgsim.errors import Outcome, unknown_name
from surgsim.models.arm import ArmModel

Array = NDArray[np.float64]


def check_backend(name: str) -> str:
    """`name`, if there is such a solver here.

    Raises:
        ValueError: If there is not.
    """
    if name in SHIPPED:
        return name
    import qpsolvers  # half a second, and only the other back ends need it

    known = sorted({*SHIPPED, *qpsolvers.available_solvers})
    if name not in known:
        raise ValueError(unknown_name(name, "QP solver installed here", known))
    return name


class QpConfig(PartConfig):
    """Convex QP inverse kinematics: hard RCM, soft tip, joint and workspace limits.

    Attributes:
        velocity_weight: Diagonal of W.
        slack_weight: Diagonal of W_s, the weight of the tip's slack.
        manipulability_weight: Weight of -q' . grad(ln mu); 0 is the paper's objective.
        tip: `soft` leaves the tip rows a slack, `hard` makes them equalities.
        k_tip: Tip feedback gain [1/s].
        k_rcm: K_rcm [1/s].
        acceleration_limit: Whether joint accelerations are limited too.
        planes: Virtual walls of the workspace.
        plane_gain_per_s: How fast the tip may approach a wall [1/s].
        solver: `daqp`, `osqp`, or another solver that qpsolvers finds installed, by its name.
    """

    type: Literal["qp"] = "qp"
    velocity_weight: PositiveFloat = 1.0
    slack_weight: PositiveFloat = 1e6
    manipulability_weight: NonNegativeFloat = 0.0
    tip: Literal["soft", "hard"] = "soft"
    k_tip: NonNegativeFloat = 5.0
    k_rcm: NonNegativeFloat = 5.0
    acceleration_limit: bool = True
    planes: tuple[PlaneConfig, ...] = ()
    plane_gain_per_s: PositiveFloat = 20.0
    solver: Annotated[str, AfterValidator(check_backend)] = "daqp"

    def build(self, arm: ArmModel) -> "Qp":
        """The resolver."""
        return Qp(self)


class Qp:
    """min 1/2 q'^T W q' + s^T W_s s - w q' . grad(ln mu), over joint velocities q' and slack s.

        J_T q' = v_d + s                        tip, soft (s = 0 when hard)
        J_rcm q' = -K_rcm e + N C'              RCM, hard: never relaxed
        Omega, |q' - q'_last| <= a_max T, q' able to stop before the position limit
        n . J_T q' <= gain (offset - n . p)     workspace planes

    Where the bounds of acceleration and Omega exclude each other, Omega holds. An infeasible program is the
    outcome INFEASIBLE with its matrices attached, never a silent zero.

    Source: passive convex teleoperation paper, sections 1.1-1.3; `passive_qp` is the whole of it.
    """

    def __init__(self, config: QpConfig) -> None:
        self._c = config
        self._planes = Planes(config.planes, config.plane_gain_per_s)
        soft = 3 if config.tip == "soft" else 0
        self._H = np.diag([config.velocity_weight] * 7 + [2.0 * config.slack_weight] * soft)
        self._free = np.full(soft, np.inf)
        self._solver = DenseQp(config.solver)

    def start(self, problem: VelocityProblem) -> Array:
        """The last joint velocity (7,): the measured one. The solver forgets its active set."""
        self._solver = DenseQp(self._c.solver)
        return problem.v.copy()

    def step(self, problem: VelocityProblem, memory: Array) -> tuple[Resolution, Array]:
        """Joint velocities for one period."""
        J, v = stacked_rows(problem, self._c.k_tip, self._c.k_rcm)
        lower, upper = self._bounds(problem, memory)
        program = self._program(problem, J, v, lower, upper)
        x = self._solver.solve(*program.values())
        if x is None:
            raise ControlFailure(
                Outcome.INFEASIBLE,
                f"QP: no joint velocity meets {len(v)} task rows, {len(self._planes)} planes and the bounds",
                program,
            )
        resolution = bounded_resolution(problem, x[:7], J, v)
        return resolution, resolution.qdot

    def _bounds(self, problem: VelocityProblem, last: Array) -> tuple[Array, Array]:
        if not self._c.acceleration_limit:
            return problem.lower, problem.upper
        return braking_bounds(problem, last)

    def _program(
        self, problem: VelocityProblem, J: Array, v: Array, lower: Array, upper: Array
    ) -> dict[str, Array]:
        """H, f, bounds and rows of the program, in the order of `DenseQp.solve`."""
        soft = len(self._free)
        f = np.zeros(7 + soft)
        if self._c.manipulability_weight:
            gradient = log_manipulability_gradient(problem.kin.Jv_WT, problem.kin.z_W)
            f[:7] = -self._c.manipulability_weight * gradient
        walls, room = self._planes.rows(problem.kin)
        G = np.zeros((len(v) + len(room), 7 + soft))
        G[: len(v), :7] = J
        G[:soft, 7:] = -np.eye(soft)
        G[len(v) :, :7] = walls
        return {
            "H": self._H,
            "f": f,
            "lower": np.concatenate((lower, -self._free)),
            "upper": np.concatenate((upper, self._free)),
            "G": G,
            "G_lower": np.concatenate((v, np.full(len(room), -np.inf))),
            "G_upper": np.concatenate((v, room)),
        }
