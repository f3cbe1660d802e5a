"""Disturbances: what the plant has and the controller's model does not."""

from surgsim.catalog import Catalog

DISTURBANCES = Catalog(
    "disturbance",
    "surgsim.disturbances",
    {
        "actuation_delay": "surgsim.plant.disturbances.actuation_delay:ActuationDelayConfig",
        "bending_shaft": "surgsim.plant.disturbances.bending_shaft:BendingShaftConfig",
        "breathing": "surgsim.plant.disturbances.breathing:BreathingConfig",
        "calibration_error": "surgsim.plant.disturbances.calibration_error:CalibrationErrorConfig",
        "force_torque_sensor": "surgsim.plant.disturbances.force_torque_sensor:ForceTorqueSensorConfig",
        "gravity_error": "surgsim.plant.disturbances.gravity_error:GravityErrorConfig",
        "guiding_hand": "surgsim.plant.disturbances.guiding_hand:GuidingHandConfig",
        "inertia_error": "surgsim.plant.disturbances.inertia_error:InertiaErrorConfig",
        "instrument_tracker": "surgsim.plant.disturbances.instrument_tracker:InstrumentTrackerConfig",
        "joint_friction": "surgsim.plant.disturbances.joint_friction:JointFrictionConfig",
        "late_ticks": "surgsim.plant.disturbances.late_ticks:LateTicksConfig",
        "payload": "surgsim.plant.disturbances.payload:PayloadConfig",
        "push": "surgsim.plant.disturbances.push:PushConfig",
        "sensor_delay": "surgsim.plant.disturbances.sensor_delay:SensorDelayConfig",
        "sensor_noise": "surgsim.plant.disturbances.sensor_noise:SensorNoiseConfig",
        "tissue": "surgsim.plant.disturbances.tissue:TissueConfig",
        "torque_bias": "surgsim.plant.disturbances.torque_bias:TorqueBiasConfig",
        "torque_quantisation": "surgsim.plant.disturbances.torque_quantisation:TorqueQuantisationConfig",
        "trocar_calibration": "surgsim.plant.disturbances.trocar_calibration:TrocarCalibrationConfig",
    },
)
