"""Velocity-level redundancy resolvers."""

from surgsim.catalog import Catalog

RESOLVERS = Catalog(
    "resolver",
    "surgsim.resolvers",
    {
        "gradient": "surgsim.control.resolvers.gradient:GradientConfig",
        "pinv": "surgsim.control.resolvers.pinv:PinvConfig",
        "rnn": "surgsim.control.resolvers.rnn:RnnConfig",
        "vprnn": "surgsim.control.resolvers.vprnn:VprnnConfig",
    },
)
