# %% [markdown]
# # 2 Write a scenario
#
# A scenario says what is simulated: arm, instrument, trocar, path of the tip, controller, and what the
# controller does not know. It is a YAML file, or a mapping in Python with the same keys.

# %%
from pathlib import Path

import surgsim

Path("tilted_circle.yaml").write_text(
    """
name: tilted_circle
description: A tilted circle 12 cm below the port
robot: {name: lwr4plus}
trocar:
  position_m: [0.55, 0.0, 0.20]     # world frame; the robot's base is its origin
task:
  type: circle
  radius_m: 0.015
  normal: [0.3, 0.0, 1.0]
  start_m: [0.565, 0.0, 0.08]
  duration_s: 4.0
controller: joint_impedance         # a shipped name, a file, or the gains in place
""",
    encoding="utf-8",
)
plain = surgsim.run("tilted_circle.yaml")
plain

# %% [markdown]
# Whatever the file does not say has a default. `load` checks a scenario and gives it with all of them:

# %%
scenario = surgsim.load("tilted_circle.yaml")
print(scenario.simulation)
print(scenario.safety.stop_at_joint_limit, scenario.seed)

# %% [markdown]
# ## Mistakes
#
# A mistake is named with file, line and key. A path that the instrument cannot follow through the trocar is
# refused too, before anything is simulated.

# %%
for wrong in ({"radius": 0.01}, {"radius_m": 0.5}):
    try:
        surgsim.run("tilted_circle.yaml", task=wrong)
    except surgsim.SurgsimError as error:
        print(error, end="\n\n")

# %% [markdown]
# ## What the controller does not know
#
# Disturbances act on the true arm, and the controller keeps its nominal model. Here a payload of 0.2 kg is
# held, and the joints have dry friction.

# %%
disturbed = surgsim.run(
    "tilted_circle.yaml",
    disturbances=[{"type": "payload", "mass_kg": 0.2}, {"type": "joint_friction"}],
)
for name in ("tip_error_rms_mm", "rcm_error_rms_mm"):
    print(f"{name}: {plain.metrics[name]:.3g} without, {disturbed.metrics[name]:.3g} with")

# %%
disturbed.figure()

# %% [markdown]
# The ramp at the start is the arm sagging under what its model leaves out. `surgsim list disturbances`
# names the others, and the [scenario format](../scenario_format.md#disturbances) has the keys of each.
#
# ## A breathing patient
#
# The port moves with the abdominal wall, and the controller sees where it is. `settings` changes single
# values by their path, as `--set` does on the command line.

# %%
for controller in ("joint_impedance", "rcm_inverse_dynamics"):
    breathing = surgsim.run(
        "tilted_circle.yaml",
        controller=controller,
        disturbances=[{"type": "breathing"}],
        settings={"disturbances.0.amplitude_m": 0.003},
    )
    print(f"{controller}: RCM error at most {breathing.metrics['rcm_error_max_mm']:.3g} mm")

# %% [markdown]
# Next: [bring a controller and compare it](bring_a_controller.py).
