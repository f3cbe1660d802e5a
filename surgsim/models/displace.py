"""Displacement of a body of a model that is not compiled yet, in the body's own frame."""

from collections.abc import Iterable

import mujoco
import numpy as np

from surgsim.array import Array

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def rotation(vector: Array) -> Array:
    """Quaternion (wxyz) of a rotation vector (3,) [rad], its direction the axis and its length the angle."""
    quat, angle = IDENTITY.copy(), float(np.linalg.norm(vector))
    if angle > 0.0:
        mujoco.mju_axisAngle2Quat(quat, vector / angle, angle)
    return quat


def about(point: Array, vector: Array) -> tuple[Array, Array]:
    """A turn about a `point` (3,) [m] by a rotation vector (3,) [rad]: x -> R x + (point - R point).

    Returns:
        Translation (3,) [m] and quaternion (wxyz).
    """
    quat = rotation(vector)
    return point - _rotated(point, quat), quat


def displace(body: mujoco.MjsBody, translation: Array, quat: Array) -> None:
    """Move `body` with all that is on it: T -> T D, with D of `translation` (3,) [m] and `quat` (wxyz).

    One that is zero leaves the body's numbers as they are. The orientation is read as a quaternion
    (`with_quaternions`).
    """
    if np.array_equal(quat, IDENTITY) and not translation.any():
        return
    turn = np.array(body.quat) / np.linalg.norm(body.quat)
    body.pos = np.array(body.pos) + _rotated(translation, turn)
    mujoco.mju_mulQuat(turn, turn.copy(), quat)
    body.quat = turn


def with_quaternions(spec: mujoco.MjSpec, names: Iterable[str]) -> None:
    """Write the orientation of bodies as quaternions, where a file gave it as angles or axes.

    What angles mean is up to the file that a body came from, and MuJoCo alone knows it: it compiles copies of
    the model with and without the orientation, whose difference the orientation is, for a body may stand in
    frames that turn it too.
    """
    given = [name for name in names if spec.body(name).alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT]
    if not given:
        return
    turned = spec.copy().compile()
    bare = spec.copy()
    for name in given:
        _set_quaternion(bare.body(name), IDENTITY)
    frames = bare.compile()
    for name in given:
        inverse, quat = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(inverse, frames.body(name).quat)
        mujoco.mju_mulQuat(quat, inverse, turned.body(name).quat)
        _set_quaternion(spec.body(name), quat)


def _set_quaternion(body: mujoco.MjsBody, quat: Array) -> None:
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.quat = quat


def _rotated(vector: Array, quat: Array) -> Array:
    out = np.zeros(3)
    mujoco.mju_rotVecQuat(out, vector, quat)
    return out
