"""Velocity-level redundancy resolvers."""

from surgsim.catalog import Catalog

RESOLVERS = Catalog(
    "resolver",
    "surgsim.resolvers",
    {
        "external": "surgsim.control.resolvers.external:ExternalConfig",
        "gradient": "surgsim.control.resolvers.gradient:GradientConfig",
        "hands_on": "surgsim.control.resolvers.hands_on:HandsOnConfig",
        "mink": "surgsim.control.resolvers.mink:MinkConfig",
        "passive_qp": "surgsim.control.resolvers.passive_qp:PassiveQpConfig",
        "pinv": "surgsim.control.resolvers.pinv:PinvConfig",
        "policy": "surgsim.control.resolvers.policy:PolicyConfig",
        "qp": "surgsim.control.resolvers.qp:QpConfig",
        "rnn": "surgsim.control.resolvers.rnn:RnnConfig",
        "self_motion": "surgsim.control.resolvers.self_motion:SelfMotionConfig",
        "vector_field_inequalities": (
            "surgsim.control.resolvers.vector_field_inequalities:VectorFieldInequalitiesConfig"
        ),
        "vprnn": "surgsim.control.resolvers.vprnn:VprnnConfig",
    },
)
