"""Torque-level laws."""

from surgsim.catalog import Catalog

TORQUE_LAWS = Catalog(
    "torque law",
    "surgsim.torque_laws",
    {
        "hierarchical_impedance": f"{__name__}.hierarchical_impedance:HierarchicalImpedanceConfig",
        "hierarchical_qp": f"{__name__}.hierarchical_qp:HierarchicalQpConfig",
        "joint_elastic_dynamics": f"{__name__}.joint_elastic_dynamics:JointElasticDynamicsConfig",
        "joint_impedance": f"{__name__}.joint_impedance:JointImpedanceConfig",
        "policy": f"{__name__}.policy:PolicyLawConfig",
        "rcm_elastic_dynamics": f"{__name__}.rcm_elastic_dynamics:RcmElasticDynamicsConfig",
        "rcm_inverse_dynamics": f"{__name__}.rcm_inverse_dynamics:RcmInverseDynamicsConfig",
    },
)
