"""Displacement of a body before its model is compiled, against MuJoCo's own frames."""

import mujoco
import numpy as np
import pytest

from surgsim.models.displace import IDENTITY, about, displace, rotation, with_quaternions
from surgsim.models.graft import graft

TURNED = """
<mujoco model="turned">
  <compiler angle="degree" eulerseq="zyx"/>
  <worldbody>
    <frame pos="0 0.1 0" euler="10 20 30">
      <body name="root" pos="0.1 0 0.2" euler="20 -30 40">
        <geom size="0.01"/>
        <body name="tilted" pos="0 0.3 0" axisangle="1 2 0 50"><geom size="0.01"/></body>
        <body name="plain" pos="0 0.3 0" quat="0.6 0 0.8 0"><geom size="0.01"/></body>
      </body>
    </frame>
  </worldbody>
</mujoco>
"""
NAMES = ("root", "tilted", "plain")


def turned():
    """The model, attached by a frame to a world that reads angles as radians in another sequence."""
    world = mujoco.MjSpec()
    world.compiler.degree, world.compiler.eulerseq = False, list("xyz")
    place = world.worldbody.add_frame(pos=[1.0, 2.0, 3.0], quat=[0.8, 0.0, 0.0, 0.6])
    graft(world, mujoco.MjSpec.from_string(TURNED), frame=place)
    return world


def poses(spec):
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return {name: (data.body(name).xpos.copy(), data.body(name).xmat.reshape(3, 3).copy()) for name in NAMES}


def test_orientations_become_quaternions_and_no_body_moves():
    plain, other = turned(), turned()
    with_quaternions(other, NAMES)
    quaternion = mujoco.mjtOrientation.mjORIENTATION_QUAT
    assert {other.body(name).alt.type for name in NAMES} == {quaternion}
    assert {plain.body(name).alt.type for name in NAMES} != {quaternion}
    before, after = poses(plain), poses(other)
    for name in NAMES:
        for a, b in zip(before[name], after[name], strict=True):
            np.testing.assert_allclose(b, a, atol=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_a_body_and_what_is_on_it_move_in_its_own_frame(name):
    d, angle = np.array([0.01, -0.02, 0.03]), 0.2
    spec = turned()
    before = poses(turned())
    with_quaternions(spec, NAMES)
    displace(spec.body(name), d, rotation(np.array([0.0, 0.0, angle])))
    p, R = before[name]
    c, s = np.cos(angle), np.sin(angle)
    found = poses(spec)
    np.testing.assert_allclose(found[name][0], p + R @ d, atol=1e-14)
    np.testing.assert_allclose(found[name][1], R @ [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], atol=1e-14)
    still = {"root": (), "tilted": ("root", "plain"), "plain": ("root", "tilted")}[name]
    for other in NAMES:
        assert np.allclose(found[other][0], before[other][0], atol=1e-14) == (other in still)


def test_a_turn_about_a_point_leaves_the_point_where_it_is():
    point, vector = np.array([0.3, -0.1, 0.2]), np.array([0.1, 0.2, -0.3])
    translation, quat = about(point, vector)
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quat)
    np.testing.assert_allclose(translation + R.reshape(3, 3) @ point, point, atol=1e-16)
    np.testing.assert_allclose(R.reshape(3, 3) @ vector, vector, atol=1e-15)  # its axis
    assert 2.0 * np.arccos(quat[0]) == pytest.approx(np.linalg.norm(vector))


def test_no_displacement_leaves_the_numbers_as_they_are():
    spec = mujoco.MjSpec.from_string(TURNED)
    body = spec.body("plain")
    before = [*body.pos, *body.quat]
    np.testing.assert_array_equal(rotation(np.zeros(3)), IDENTITY)
    displace(body, np.zeros(3), rotation(np.zeros(3)))
    assert [*body.pos, *body.quat] == before
