"""MuJoCo's warnings: without a handler it appends them to MUJOCO_LOG.TXT in the working folder."""

import mujoco


def keep_off_the_disk() -> None:
    """Give MuJoCo a handler that drops warnings, unless a person gave it one.

    What they warn of is noticed otherwise: a state that is not finite ends the run as `diverged`.
    """
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(_drop)


def _drop(text: str) -> None:
    """Write nothing anywhere."""
