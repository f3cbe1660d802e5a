"""Torque-level laws."""

from surgsim.catalog import Catalog

TORQUE_LAWS = Catalog(
    "torque law",
    "surgsim.torque_laws",
    {
        "adaptive_decoupling": f"{__name__}.adaptive_decoupling:AdaptiveDecouplingConfig",
        "constraint_consistent": f"{__name__}.constraint_consistent:ConstraintConsistentConfig",
        "external": f"{__name__}.external:ExternalLawConfig",
        "hierarchical_impedance": f"{__name__}.hierarchical_impedance:HierarchicalImpedanceConfig",
        "hierarchical_qp": f"{__name__}.hierarchical_qp:HierarchicalQpConfig",
        "joint_elastic_dynamics": f"{__name__}.joint_elastic_dynamics:JointElasticDynamicsConfig",
        "joint_impedance": f"{__name__}.joint_impedance:JointImpedanceConfig",
        "joint_reference": f"{__name__}.joint_reference:JointReferenceConfig",
        "null_space_basis": f"{__name__}.null_space_basis:NullSpaceBasisConfig",
        "policy": f"{__name__}.policy:PolicyLawConfig",
        "projected_jacobian": f"{__name__}.projected_jacobian:ProjectedJacobianConfig",
        "rcm_elastic_dynamics": f"{__name__}.rcm_elastic_dynamics:RcmElasticDynamicsConfig",
        "rcm_inverse_dynamics": f"{__name__}.rcm_inverse_dynamics:RcmInverseDynamicsConfig",
        "rcm_mpc": f"{__name__}.rcm_mpc:RcmMpcConfig",
        "rcm_sliding_mode": f"{__name__}.rcm_sliding_mode:RcmSlidingModeConfig",
    },
)
