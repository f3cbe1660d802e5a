"""Disturbances: what the plant has and the controller's model does not."""

from surgsim.catalog import Catalog

DISTURBANCES = Catalog(
    "disturbance",
    "surgsim.disturbances",
    {
        "payload": "surgsim.plant.disturbances.payload:PayloadConfig",
    },
)
