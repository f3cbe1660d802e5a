"""A controller in Python: joint velocities by least squares, or joint torques of an impedance.

    surgsim run circle_lwr4plus --controller external_velocity --external mine='python controller.py'
    surgsim run circle_lwr4plus --controller external_torque --external mine='python controller.py'

With `--dies-at T` it ends by itself at T s, `--hangs-at T` no longer answers, `--raves-at T` gives what is no
number: so one can see what surgsim makes of that.
"""

import sys
import time

import numpy as np
from surgsim_external import serve

K_PER_S = 5.0
BANDWIDTH_PER_S = 60.0
DIES, HANGS, RAVES = "--dies-at", "--hangs-at", "--raves-at"


def velocity(seen):
    """Q' = pinv(J) v, J = [J_T; J_rcm], v = [v_d - k (p - p_d); N C' - k e]."""
    rows = int(seen["rows"])
    J = np.vstack([seen["Jv_WT"], seen["J_rcm"][:rows]])
    tip = seen["v_WTd"] - K_PER_S * (seen["p_WT"] - seen["p_WTd"])
    shaft = seen["rcm_velocity"] - K_PER_S * seen["rcm_error"]
    return J.T @ np.linalg.solve(J @ J.T, np.concatenate([tip, shaft[:rows]]))


def torque(seen):
    """Tau = M (w^2 (q_ref - q) + 2 w (q_ref' - q')) + D q_ref'; surgsim adds gravity."""
    w, error, slower = BANDWIDTH_PER_S, seen["q_ref"] - seen["q"], seen["qdot_ref"] - seen["v"]
    return seen["M"] @ (w * w * error + 2.0 * w * slower) + seen["damping"] * seen["qdot_ref"]


def start(arm, gives):
    """What answers, for an arm."""
    words = sys.argv[1:]
    ends = {words[i]: float(words[i + 1]) for i in range(0, len(words), 2)}
    answer = velocity if gives == "joint_velocity" else torque

    def asked(seen):
        t = float(seen["t_s"])
        if t >= ends.get(DIES, np.inf):
            sys.exit("the controller dies, as it was told to")
        if t >= ends.get(HANGS, np.inf):
            time.sleep(3600.0)
        if t >= ends.get(RAVES, np.inf):
            return np.full(len(arm["joints"]), np.nan)
        return answer(seen)

    return asked


if __name__ == "__main__":
    serve("example in Python", "1.0", start)
