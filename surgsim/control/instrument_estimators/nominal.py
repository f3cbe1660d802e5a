"""The instrument where the nominal model has it: no estimation."""

from typing import Literal

import numpy as np

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.instrument_estimators.base import KernelInstrumentEstimator
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.status import GOES_ON


class NominalInstrumentConfig(PartConfig):
    """Takes the nominal model as it is."""

    type: Literal["nominal"] = "nominal"

    def build(self, arm: ArmModel) -> KernelInstrumentEstimator:
        """The estimator, which a tick leaves out."""
        return KernelInstrumentEstimator(
            kernel=nominal_instrument, arm=arm, gains=np.zeros(0), corrects=False
        )


@compiled
def nominal_instrument(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """No correction."""
    for k in range(2):
        for i in range(3):
            out[k, i] = 0.0
    return GOES_ON
