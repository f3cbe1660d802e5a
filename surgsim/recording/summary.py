"""The text panel of a recording: how the run ended, its metrics, its scenario."""

from collections.abc import Mapping
from itertools import zip_longest

from surgsim.scenario.yaml_text import dump_yaml
from surgsim.trace.trace import TraceMeta


def result_markdown(meta: TraceMeta, metrics: Mapping[str, float | None]) -> str:
    """Outcome and metrics as Markdown."""
    ending = meta.ending
    head = f"**{meta.scenario['name']}: {ending.outcome.name.lower()}.** {outcome_sentence(meta)}\n"
    cells = [f"{name} | {_number(value)}" for name, value in metrics.items()]
    half = (len(cells) + 1) // 2
    rows = zip_longest(cells[:half], cells[half:], fillvalue=" | ")
    table = ["| metric | value | metric | value |", "|---|---|---|---|", *(f"| {a} | {b} |" for a, b in rows)]
    return "\n".join([head, *(table if cells else [])]) + "\n"


def scenario_markdown(meta: TraceMeta) -> str:
    """The resolved scenario as a block of YAML."""
    return f"```yaml\n{dump_yaml(meta.scenario)}```\n"


def outcome_sentence(meta: TraceMeta) -> str:
    """How and when the run ended, in one sentence."""
    ending = meta.ending
    detail = f" ({ending.detail})" if ending.detail else ""
    return f"{ending.outcome.value.removesuffix('.')}{detail}, at {ending.t_s:.3f} s."


def _number(value: float | None) -> str:
    return "does not apply" if value is None else f"{value:.4g}"
