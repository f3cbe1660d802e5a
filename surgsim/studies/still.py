"""The velocity problem of one instant of a path, held still, for resolvers on their own."""

from dataclasses import replace

from surgsim.control.problem import VelocityProblem, velocity_bounds
from surgsim.control.rcm import rcm_kinematics
from surgsim.simulate.setup import Setup


def still_problem(setup: Setup, at_s: float, period_s: float) -> VelocityProblem:
    """The arm at its start configuration, asked for the path's velocity of `at_s` [s] and no more."""
    state = setup.plant.reset(setup.q_start)
    gain = setup.scenario.controller.position_gain_per_s
    lower, upper = velocity_bounds(state.q, setup.arm.limits, gain)
    command, here = setup.task.command(at_s), setup.arm.kinematics(state.q)
    return VelocityProblem(
        t_s=0.0,
        dt_s=period_s,
        q=state.q,
        v=state.v,
        kin=here,
        command=replace(command, p_WTd=here.p_WT),
        rcm=rcm_kinematics(here, state.p_WC, state.v_WC),
        p_WC=state.p_WC,
        v_WC=state.v_WC,
        lower=lower,
        upper=upper,
        limits=setup.arm.limits,
        position_gain_per_s=gain,
    )
