# %% [markdown]
# # 3 Bring a controller and compare it
#
# A controller of yours can be other gains, a program of its own, or a part of surgsim. This page does the
# first two; [add a controller](../add_a_controller.md) does the third.
#
# ## Other gains
#
# A controller is a resolver, which turns the task into joint velocities, and a torque law, which turns
# those into torques. A mapping with both is a controller. This one is the shipped `pinv`, stiffer at the
# trocar:

# %%
import subprocess
import sys
from pathlib import Path

import surgsim

stiffer = {
    "name": "stiffer",
    "resolver": {"type": "pinv"},
    "torque_law": {"type": "hierarchical_impedance", "rcm_stiffness_n_per_m": 3000.0},
}
for controller in ("pinv", stiffer):
    run = surgsim.run("circle_lwr4plus", controller=controller, task={"duration_s": 4.0})
    print(f"{run.controller}: RCM error at most {run.metrics['rcm_error_max_mm']:.2g} mm")

# %% [markdown]
# ## A program of your own
#
# A program in any language can be the controller. surgsim asks it once every control tick and waits for its
# answer. In Python that takes one function. The reader of the messages and their layout are printed by the
# command `surgsim external`, and stand beside it.
#
# This one is a spring and a damper in each joint. They pull the joints to the reference that surgsim
# computes from the path. surgsim adds the torques of gravity.

# %%
for kind, file in (("python", "surgsim_external.py"), ("layout", "layout.json")):
    printed = subprocess.check_output([sys.executable, "-m", "surgsim", "external", kind])
    Path(file).write_bytes(printed)
Path("my_controller.py").write_text(
    """
from surgsim_external import serve


def start(arm, gives):
    def answer(seen):
        spring = 2000.0 * (seen["q_ref"] - seen["q"])
        damper = 60.0 * (seen["qdot_ref"] - seen["v"])
        return spring + damper

    return answer


serve("springs", "0.1", start)
""",
    encoding="utf-8",
)
mine = {"mine": f"{sys.executable} my_controller.py"}
run = surgsim.run("circle_lwr4plus", controller="external_torque", externals=mine, task={"duration_s": 4.0})
run.figure()

# %% [markdown]
# ## Compare
#
# A comparison runs each controller on the same scenario with the same seeds. The seed draws what varies:
# here the payload is drawn within 20 % around its mass. Failed runs are rows too.

# %%
found = surgsim.compare(
    "circle_lwr4plus",
    controllers=[stiffer, "external_torque", "rcm_inverse_dynamics"],
    seeds=range(5),
    task={"duration_s": 4.0},
    disturbances=[{"type": "payload", "spread": 0.2}],
    externals=mine,
)
found

# %%
print(found.leaderboard("rcm_error_rms_mm"))

# %% [markdown]
# The interval behind each value says how far it would move with other seeds. Five seeds are the fewest that
# give one: [how to read a leaderboard](../concepts/leaderboards.md) says what the columns mean and when a
# difference counts.
#
# `found.report("report.html")` writes a page with figures, and `out="runs/mine"` keeps the runs.
#
# Next: [bring an arm](bring_an_arm.py).
