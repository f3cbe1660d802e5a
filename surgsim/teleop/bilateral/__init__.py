"""Bilateral schemes: what either side sends, what the hand feels, where the tip is led.

    handle ── feel ──▶ force          follow ──▶ velocity of the tip
           ── tell ──▶ message ── channel ──▶ follow ──▶ message ── channel ──▶ feel

A scheme is three kernels that see and fill one record, `surgsim.teleop.bilateral.base.End`.
"""

from surgsim.catalog import Catalog

BILATERAL = Catalog(
    "bilateral scheme",
    "surgsim.bilateral",
    {
        "four_channel": f"{__name__}.four_channel:FourChannelConfig",
        "p_plus_d": f"{__name__}.p_plus_d:PPlusDConfig",
        "passive_convex": f"{__name__}.passive_convex:PassiveConvexConfig",
        "passive_set_position": f"{__name__}.passive_set_position:PassiveSetPositionConfig",
        "position_force": f"{__name__}.position_force:PositionForceConfig",
        "position_position": f"{__name__}.position_position:PositionPositionConfig",
        "time_domain": f"{__name__}.time_domain:TimeDomainConfig",
        "two_layer": f"{__name__}.two_layer:TwoLayerConfig",
        "wave_variables": f"{__name__}.wave_variables:WaveVariablesConfig",
    },
)
