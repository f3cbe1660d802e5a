"""The trocar as it is seen: no estimation."""

from typing import Literal

import numpy as np

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.port_estimators.base import KernelPortEstimator
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.status import GOES_ON


class MeasuredPortConfig(PartConfig):
    """Takes position as seen and velocity as announced."""

    type: Literal["measured"] = "measured"

    def build(self, arm: ArmModel) -> KernelPortEstimator:
        """The estimator."""
        return KernelPortEstimator(kernel=measured_port, arm=arm, gains=np.zeros(0), estimates=False)


@compiled
def measured_port(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """p_WC and v_WC as they are seen, no acceleration."""
    for i in range(3):
        out[0, i], out[1, i], out[2, i] = seen.p_WC[i], seen.v_WC[i], 0.0
    return GOES_ON
