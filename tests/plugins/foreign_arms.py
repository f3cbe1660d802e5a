"""Arms as other people write them: other names, degrees, servos, hands, rails, meshes, a scene around."""

import struct
from pathlib import Path

import numpy as np

NAMES = ("A1", "A2", "E1", "A3", "A4", "A5", "A6")

MJCF = """
<mujoco model="their arm">
  <compiler angle="degree" meshdir="meshes" autolimits="true"/>
  <default>
    <joint damping="0.5" armature="0.05"/>
    <default class="big"><position kp="2000" kv="200" forcerange="-150 150"/></default>
  </default>
  <asset><mesh name="shell" file="shell.stl"/><mesh name="lost" file="not_there.stl"/></asset>
  <worldbody>
    <geom type="plane" size="2 2 .1"/>
    <body name="table" pos="0 0 -1"><geom type="box" size="1 1 .1"/></body>
    <body name="rail" pos="0 0 .3">
      <joint name="rail" type="slide" axis="1 0 0" range="-1 1"/>
      <geom type="box" size=".1 .1 .02"/>
      <body name="pedestal" pos="0 0 .05" euler="0 0 30">
        <inertial pos="0 0 0" mass="4" diaginertia=".1 .1 .1"/>
        <geom type="cylinder" size=".08 .05"/>
        <body name="l1" pos="0 0 .1">
          <joint name="A1" axis="0 0 1" range="-170 170"/>
          <inertial pos="0 .02 .1" mass="3" diaginertia=".02 .02 .01"/>
          <geom type="capsule" fromto="0 0 0 0 0 .2" size=".06"/>
          <body name="head" pos="0 .1 .1">
            <joint name="pan" axis="0 0 1"/>
            <inertial pos="0 .05 0" mass=".7" diaginertia=".002 .002 .002"/>
          </body>
          <body name="l2" pos="0 0 .21" euler="90 0 0">
            <joint name="A2" axis="0 0 1" range="-120 120"/>
            <inertial pos="0 .1 .02" mass="3" fullinertia=".02 .01 .02 .001 0 .002"/>
            <geom type="mesh" mesh="shell"/>
            <geom type="mesh" mesh="lost" contype="0" conaffinity="0"/>
            <body name="l3" pos="0 .2 0" euler="-90 0 0">
              <joint name="E1" axis="0 0 1" range="-170 170"/>
              <inertial pos="0 -.02 .1" mass="2.5" diaginertia=".02 .02 .01"/>
              <geom type="capsule" fromto="0 0 0 0 0 .2" size=".06"/>
              <body name="l4" pos="0 0 .2" euler="-90 0 0">
                <joint name="A3" axis="0 0 1" range="-120 120" ref="20"/>
                <inertial pos="0 -.1 .02" mass="2.5" diaginertia=".02 .01 .02"/>
                <geom type="capsule" fromto="0 0 0 0 -.19 0" size=".06"/>
                <body name="l5" pos="0 -.2 0" euler="90 0 0">
                  <joint name="A4" axis="0 0 1" range="-170 170"/>
                  <inertial pos="0 .02 .1" mass="1.6" diaginertia=".006 .006 .003"/>
                  <geom type="capsule" fromto="0 0 0 0 0 .18" size=".055"/>
                  <body name="l6" pos="0 0 .19" euler="90 0 0">
                    <joint name="A5" axis="0 0 1" range="-120 120"/>
                    <inertial pos="0 0 0" mass="1.6" diaginertia=".004 .004 .004"/>
                    <geom type="sphere" size=".055"/>
                    <body name="l7" pos="0 .02 0" euler="-90 0 0">
                      <joint name="A6" axis="0 0 1"/>
                      <inertial pos="0 0 .03" mass=".3" diaginertia=".0004 .0004 .0004"/>
                      <geom type="cylinder" size=".035 .03" pos="0 0 .03"/>
                      <body name="plate" pos="0 0 .06" euler="0 0 45">
                        <inertial pos="0 0 .005" mass=".1" diaginertia=".0001 .0001 .0001"/>
                        <site name="attachment_site" pos="0 0 .01"/>
                        <body name="hand" pos="0 0 .01">
                          <inertial pos="0 0 .03" mass=".5" diaginertia=".001 .001 .001"/>
                          <body name="finger" pos="0 .02 .05">
                            <joint name="finger" type="slide" axis="0 1 0" range="0 .04"/>
                            <geom type="box" size=".01 .01 .02"/>
                          </body>
                        </body>
                      </body>
                    </body>
                  </body>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position class="big" joint="A1"/><position class="big" joint="A2"/>
    <motor joint="E1" gear="50" ctrlrange="-2 2"/>
    <general joint="A3" gainprm="10" ctrlrange="-9 9" forcerange="-80 80"/>
    <motor joint="A4" ctrlrange="-70 90"/><motor joint="A5" ctrlrange="-40 40"/>
    <position joint="A6" kp="100" forcerange="-30 30"/><position joint="finger" kp="10"/>
  </actuator>
  <keyframe><key name="home" qpos="0 0 0 0.4 0 1.0 0 0.5 0 0"/></keyframe>
</mujoco>
"""
"""A 7-joint arm on a rail, with a head that pans and a hand."""

URDF = """<?xml version="1.0"?>
<robot name="their_arm">
  <link name="root"/>
  <joint name="stand" type="fixed">
    <parent link="root"/><child link="base_link"/><origin xyz="0 0 0.1"/>
  </joint>
  <link name="base_link">
    <visual><geometry><mesh filename="package://their_arm/meshes/shell.stl"/></geometry></visual>
    <visual><geometry><mesh filename="package://their_arm/meshes/base.dae"/></geometry></visual>
  </link>
  {links}
  <link name="tool0"/>
  <joint name="to_tool" type="fixed">
    <parent link="link_{n}"/><child link="tool0"/><origin xyz="0 0 0.08" rpy="0 0 0.3"/>
  </joint>
</robot>
"""

_LINK = """
  <link name="link_{i}">
    <inertial><origin xyz="0 0.01 0.05"/><mass value="{mass}"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision>
      <origin xyz="0 0 0.06"/><geometry><cylinder radius="0.05" length="0.12"/></geometry>
    </collision>
  </link>
  <joint name="joint_{i}" type="{kind}">
    <parent link="{parent}"/><child link="link_{i}"/><origin xyz="0 0 {step}" rpy="{turn} 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" velocity="{velocity}" effort="{effort}"/>
    <dynamics damping="0.2" friction="0.1"/>
  </joint>"""


def urdf_text(n: int = 6) -> str:
    """A URDF of n joints; the first is continuous."""
    links = [
        _LINK.format(
            i=i,
            mass=4.0 - 0.4 * i,
            kind="continuous" if i == 1 else "revolute",
            parent="base_link" if i == 1 else f"link_{i - 1}",
            step=0.15,
            turn=0.0 if i == 1 else np.pi / 2 * (-1) ** i,
            velocity=1.0 + 0.1 * i,
            effort=max(20, 150 - 20 * i),
        )
        for i in range(1, n + 1)
    ]
    return URDF.format(links="".join(links), n=n)


def write_stl(path: Path, half: tuple[float, float, float] = (0.05, 0.1, 0.05), up: float = 0.1) -> None:
    """A box as a binary STL, from -half to half, moved by `up` along y."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half + [0.0, up, 0.0]
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = [(q[0], q[i], q[i + 1]) for q in quads for i in (1, 2)]
    data = bytes(80) + struct.pack("<I", len(triangles))
    for triangle in triangles:
        data += struct.pack("<12fH", 0, 0, 0, *corners[list(triangle)].ravel(), 0)
    path.write_bytes(data)


def write_mjcf(folder: Path) -> Path:
    """The MJCF in `folder`, with its mesh."""
    (folder / "meshes").mkdir()
    write_stl(folder / "meshes" / "shell.stl")
    path = folder / "arm.xml"
    path.write_text(MJCF)
    return path


def write_urdf(folder: Path, n: int = 6) -> Path:
    """A URDF of n joints inside of its package, which is put into `folder`."""
    package = folder / "their_arm"
    (package / "urdf").mkdir(parents=True)
    (package / "meshes").mkdir()
    write_stl(package / "meshes" / "shell.stl")
    path = package / "urdf" / "arm.urdf"
    path.write_text(urdf_text(n))
    return path
