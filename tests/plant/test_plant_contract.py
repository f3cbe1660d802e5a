"""What a plant must have: the check that outside packages' plants are held to."""

import pytest

from surgsim.contract.check import BrokenPromiseError
from surgsim.contract.plant_parts import has_what_is_used
from surgsim.plant.kinematic import KinematicPlant, KinematicPlantConfig


class Forgetful:
    """A plant whose state cannot be stored."""

    def __init__(self, plant):
        self._plant = plant

    def __getattr__(self, name):
        if name in ("arrays", "objects"):
            raise AttributeError(name)
        return getattr(self._plant, name)


class ForgetfulConfig(KinematicPlantConfig):
    def build(self, scene, control_period_s, parts, seed):
        return Forgetful(KinematicPlant(scene, control_period_s))


def test_a_plant_that_lacks_what_a_run_uses_is_told_what():
    has_what_is_used(KinematicPlantConfig)
    with pytest.raises(BrokenPromiseError, match="6 joints: the plant has no arrays, objects"):
        has_what_is_used(ForgetfulConfig)
