"""Named networks: what a channel's `preset` stands for, one way, and where the numbers come from."""

from typing import Literal

NetworkName = Literal["lan", "fibre_transatlantic", "5g", "4g", "geo_satellite"]
NETWORKS: dict[NetworkName, dict[str, float]] = {
    "lan": {"delay_s": 0.001, "jitter_s": 0.0, "loss": 0.0},
    "fibre_transatlantic": {"delay_s": 0.078, "jitter_s": 0.0, "loss": 0.0},
    "5g": {"delay_s": 0.012, "jitter_s": 0.004, "loss": 0.001, "burst_packets": 5.0},
    "4g": {"delay_s": 0.025, "jitter_s": 0.01, "loss": 0.005, "burst_packets": 10.0},
    "geo_satellite": {"delay_s": 0.279, "jitter_s": 0.002, "loss": 0.001},
}
"""Keys of a channel by the network's name.

Delays: `lan` a control period, the least that a channel here has; `fibre_transatlantic` half of the 155 ms
round trip of the operation from New York to Strasbourg (Marescaux et al., Nature 413, 2001); `5g` between the
7 ms downlink and the 18 ms uplink that Rohde & Schwarz measured one way in a public network (Kottkamp, 2022);
`geo_satellite` one hop to ground stations at the edge of the satellite's view, RFC 2488, section 2. `4g` is
an assumption: a round trip of 50 ms. Jitter, loss and bursts are assumptions: the sources state none for
such packets.
"""
