"""Torque-level laws."""

from surgsim.catalog import Catalog

TORQUE_LAWS = Catalog(
    "torque law",
    "surgsim.torque_laws",
    {
        "external": f"{__name__}.external:ExternalLawConfig",
        "hierarchical_impedance": f"{__name__}.hierarchical_impedance:HierarchicalImpedanceConfig",
        "joint_elastic_dynamics": f"{__name__}.joint_elastic_dynamics:JointElasticDynamicsConfig",
        "joint_impedance": f"{__name__}.joint_impedance:JointImpedanceConfig",
        "policy": f"{__name__}.policy:PolicyLawConfig",
        "rcm_elastic_dynamics": f"{__name__}.rcm_elastic_dynamics:RcmElasticDynamicsConfig",
        "rcm_inverse_dynamics": f"{__name__}.rcm_inverse_dynamics:RcmInverseDynamicsConfig",
    },
)
