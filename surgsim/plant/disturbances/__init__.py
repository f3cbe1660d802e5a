"""Disturbances: what the plant has and the controller's model does not."""

from surgsim.catalog import Catalog

DISTURBANCES = Catalog(
    "disturbance",
    "surgsim.disturbances",
    {
        "actuation_delay": "surgsim.plant.disturbances.actuation_delay:ActuationDelayConfig",
        "inertia_error": "surgsim.plant.disturbances.inertia_error:InertiaErrorConfig",
        "joint_friction": "surgsim.plant.disturbances.joint_friction:JointFrictionConfig",
        "payload": "surgsim.plant.disturbances.payload:PayloadConfig",
        "push": "surgsim.plant.disturbances.push:PushConfig",
    },
)
