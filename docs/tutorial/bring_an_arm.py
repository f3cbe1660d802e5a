# %% [markdown]
# # 4 Bring an arm
#
# An arm that you have as an MJCF or URDF file runs in a scenario by naming the file. Any file will do; here
# a small arm of seven joints is written first, so that this page needs no other.

# %%
import subprocess
import sys
from pathlib import Path

import surgsim

# Of each link: place and turn of its joint on the link before it, range [deg], torque [N m], shape.
LINKS = [
    ("0 0 0.12", "0 0 0", 170, 180, "0 0 0.03 0 0 0.2"),
    ("0 0 0.2", "90 0 0", 115, 180, "0 0.03 0 0 0.17 0"),
    ("0 0.2 0", "-90 0 0", 170, 100, "0 0 0.03 0 0 0.17"),
    ("0 0 0.2", "-90 0 0", 120, 100, "0 -0.03 0 0 -0.16 0"),
    ("0 -0.2 0", "90 0 0", 170, 100, "0 0 0.03 0 0 0.16"),
    ("0 0 0.2", "90 0 0", 120, 40, "0 -0.02 0 0 0.02 0"),
    ("0 0 0", "-90 0 0", 175, 40, "0 0 0.03 0 0 0.09"),
]
inside = '<site name="tool" pos="0 0 0.1"/>'
for number, (place, turn, degrees, torque, shape) in reversed(list(enumerate(LINKS, start=1))):
    inside = f"""<body name="link{number}" pos="{place}" euler="{turn}">
      <joint name="j{number}" range="-{degrees} {degrees}" actuatorfrcrange="-{torque} {torque}"/>
      <geom fromto="{shape}"/>
      {inside}
    </body>"""
Path("my_arm.xml").write_text(
    f"""<mujoco model="my_arm">
  <compiler angle="degree" autolimits="true"/>
  <default>
    <joint axis="0 0 1" damping="0.5" armature="0.1"/>
    <geom type="capsule" size="0.045" density="900"/>
  </default>
  <worldbody><body name="foot">
    <geom type="cylinder" size="0.09 0.06" fromto="0 0 0 0 0 0.12"/>
    {inside}
  </body></worldbody>
</mujoco>""",
    encoding="utf-8",
)

# %% [markdown]
# ## A scenario names the file
#
# `flange` is the site or body that carries the instrument; the shaft points along its z axis. Where the arm
# starts is looked for among all postures that can follow the path.

# %%
scenario = {
    "name": "my_circle",
    "robot": {"mjcf": "my_arm.xml", "flange": "tool"},
    "trocar": {"position_m": [0.5, 0.0, 0.15]},
    "task": {"type": "circle", "radius_m": 0.02, "start_m": [0.52, 0.0, 0.0], "duration_s": 3.0},
    "controller": "rcm_inverse_dynamics",
}
run = surgsim.run(scenario)
run

# %%
run.figure()

# %% [markdown]
# ## What surgsim made of it
#
# `surgsim adopt` writes the arm into a folder with a card, which says what was taken from the file, what
# was assumed, and what is lacking. Without `--quick` it also tries where a port can be.

# %%
adopt = [sys.executable, "-m", "surgsim", "adopt", "my_arm.xml", "--flange", "tool", "--quick"]
subprocess.run(adopt, check=True, capture_output=True)
print(Path("robots/my_arm/README.md").read_text(encoding="utf-8"))

# %% [markdown]
# ## Its drives
#
# So far the commanded torque acts on the joints as it is. Real arms have motors behind elastic gears, which
# decide which controllers work at all: [drives and calibration](../concepts/drives.md). With the stiffness
# of the gears and the inertia of the rotors the arm gets drives:

# %%
drive = {"stiffness_nm_per_rad": [10000.0] * 5 + [5000.0] * 2, "rotor_inertia_kg_m2": [0.6] * 4 + [0.2] * 3}
for controller in ("rcm_inverse_dynamics", "rcm_elastic_dynamics"):
    on_drives = surgsim.run(scenario, robot={"drive": drive}, controller=controller)
    print(f"{controller}: {on_drives.ended}")

# %% [markdown]
# [Add a robot](../add_a_robot.md) has the rest: names for arms, URDF files, flanges whose x points along
# the shaft, packages that bring an arm.
