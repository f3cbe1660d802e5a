"""Torque-level laws."""

from surgsim.catalog import Catalog

TORQUE_LAWS = Catalog(
    "torque law",
    "surgsim.torque_laws",
    {
        "hierarchical_impedance": f"{__name__}.hierarchical_impedance:HierarchicalImpedanceConfig",
    },
)
