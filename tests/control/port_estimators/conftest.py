"""An arm in the port, for estimators of the port."""

import numpy as np
import pytest

from surgsim.control.port_estimators.base import PortProblem

DT = 0.001


@pytest.fixture
def problem(arm, velocity_problem):
    """An arm at rest with its shaft through the port."""
    p = velocity_problem(3, rcm_error_m=0.0, trocar_speed=0.0)
    kin, dyn = arm.evaluate(p.q, np.zeros(7))
    return PortProblem(
        t_s=0.0,
        dt_s=DT,
        q=p.q,
        v=np.zeros(7),
        tau_measured=dyn.bias.copy(),
        kin=kin,
        dyn=dyn,
        p_WC=p.p_WC,
        v_WC=np.zeros(3),
    )
