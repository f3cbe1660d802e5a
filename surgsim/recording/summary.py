"""The text panel of a recording: how the run ended, its metrics, its scenario."""

from collections.abc import Mapping

from surgsim.scenario.yaml_text import dump_yaml
from surgsim.trace.trace import TraceMeta


def result_markdown(meta: TraceMeta, metrics: Mapping[str, float | None]) -> str:
    """Outcome, and those metrics that apply, as Markdown."""
    ending = meta.ending
    head = f"**{meta.scenario['name']}: {ending.outcome.name.lower()}.** {outcome_sentence(meta)}\n"
    rows = [f"| {name} | {value:.4g} |" for name, value in metrics.items() if value is not None]
    table = ["| metric | value |", "|---|---|", *rows]
    return "\n".join([head, *(table if rows else [])]) + "\n"


def scenario_markdown(meta: TraceMeta) -> str:
    """The resolved scenario as a block of YAML."""
    return f"```yaml\n{dump_yaml(meta.scenario)}```\n"


def outcome_sentence(meta: TraceMeta) -> str:
    """How and when the run ended, in one sentence."""
    ending = meta.ending
    detail = f" ({ending.detail})" if ending.detail else ""
    return f"{ending.outcome.value.removesuffix('.')}{detail}, at {ending.t_s:.3f} s."
