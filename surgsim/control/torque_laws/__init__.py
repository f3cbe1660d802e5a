"""Torque-level laws."""

from surgsim.catalog import Catalog

TORQUE_LAWS = Catalog(
    "torque law",
    "surgsim.torque_laws",
    {
        "hierarchical_impedance": f"{__name__}.hierarchical_impedance:HierarchicalImpedanceConfig",
        "joint_impedance": f"{__name__}.joint_impedance:JointImpedanceConfig",
        "policy": f"{__name__}.policy:PolicyLawConfig",
        "rcm_inverse_dynamics": f"{__name__}.rcm_inverse_dynamics:RcmInverseDynamicsConfig",
    },
)
