"""The simulated plant: the only code that writes MuJoCo's data."""

from surgsim.catalog import Catalog

PLANTS = Catalog(
    "plant",
    "surgsim.plants",
    {
        "dynamic": "surgsim.plant.dynamic:DynamicPlantConfig",
        "kinematic": "surgsim.plant.kinematic:KinematicPlantConfig",
    },
)
DEFAULT = "dynamic"
"""The plant of a scenario that names none."""
