"""Port estimators: where the controller believes the trocar to be, and how it moves."""

from surgsim.catalog import Catalog

PORT_ESTIMATORS = Catalog(
    "port estimator",
    "surgsim.port_estimators",
    {
        "admittance": f"{__name__}.admittance:PortAdmittanceConfig",
        "interaction_force": f"{__name__}.interaction_force:InteractionForceConfig",
        "measured": f"{__name__}.measured:MeasuredPortConfig",
        "tracking": f"{__name__}.tracking:TrackingConfig",
    },
)
