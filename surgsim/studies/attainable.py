"""The largest manipulability that self-motion reaches along a path, by the timing of a run."""

from collections.abc import Iterable

import numpy as np

from surgsim.array import Array
from surgsim.studies.study import Curves
from surgsim.tasks.profile import Profile


def attainable_by_timing(
    smooth: Iterable[Curves], ours: Curves, steps: int, profile: Profile
) -> dict[str, Array]:
    """Largest mu that self-motion reaches along a path, at every step (steps + 1,) of a run by its timing.

    At each sample the largest that was found from any of the smooth runs, and by our run itself: the runs
    have the same tip positions at the same rows, so that what one of them finds another could have reached.
    Between samples mu* is interpolated linearly.

    Args:
        smooth: Runs with ramps: `attainable` and the steps of its samples, `attainable_step`.
        ours: The run that has them too, and `mu` at every step.
        steps: Number of steps.
        profile: The timing with ramps; `paper` is constant speed from the first step.
    """
    every, best = np.arange(steps + 1), np.max([curves["attainable"] for curves in smooth], axis=0)
    mu = np.maximum(np.interp(every, ours["attainable_step"], best), ours["mu"])
    progress = np.array([profile.progress(k * profile.duration_s / steps)[0] for k in every])
    return {"smooth": mu, "paper": np.interp(np.linspace(0.0, 1.0, steps + 1), progress, mu)}
