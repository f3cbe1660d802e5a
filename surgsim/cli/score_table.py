"""A score as a person reads it on a terminal: failures first."""

from typing import TYPE_CHECKING, Any

from surgsim.cli.table import print_prose, print_table

if TYPE_CHECKING:
    from surgsim.protocol.definition import ProtocolConfig
    from surgsim.protocol.score import Score


def print_score(score: "Score", protocol: "ProtocolConfig") -> None:
    """Print the sentence, the scorecard and the axes."""
    from surgsim.protocol.score_text import axis_told, figure_told, sentence, timing_told, tuning_told

    card = score.scorecard
    for line in sentence(score):
        print_prose(line)
    rows = [(figure.label, *figure_told(card["figures"][name])) for name, figure in protocol.figures.items()]
    rows.append(("ticks of the controller later than their period, on this machine", timing_told(score), ""))
    rows.append(("tuning", tuning_told(card["tuning"]), ""))
    print_table(f"\n{score.name}, track {card['track']}", ("figure", "value", "95 %"), rows, right=(1, 2))
    axes = [(axis["label"], axis_told(axis), _levels(axis)) for axis in card["axes"]]
    if axes:
        print_table("\nAxes", ("axis", "first failing level", "levels"), axes)


def _levels(axis: dict[str, Any]) -> str:
    return ", ".join(f"{level['level']:g}" for level in axis["levels"][1:])
