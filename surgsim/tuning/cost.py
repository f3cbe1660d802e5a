"""What a candidate costs: runs that failed first, then errors of RCM and tip, then a rough command."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

COMPLETED = "completed"


@dataclass(frozen=True, kw_only=True)
class Weights:
    """The numbers of the cost.

    Attributes:
        failure: Of a run that failed: more than accuracy can ever make up for.
        early: Added to it for one that failed at once; half of it for one that failed after 1 s.
        floor_mm: Added to both errors [mm]: what is far below an arm's repeatability is no gain.
        allowed: Share of ticks in which torques may change faster than their limit, or be cut.
        rough: Of a share of 1 above what is allowed.
    """

    failure: float = 1000.0
    early: float = 100.0
    floor_mm: float = 0.01
    allowed: float = 0.01
    rough: float = 20.0


WEIGHTS = Weights()
ERRORS = ("rcm_error_rms_mm", "tip_error_rms_mm")
SHARES = ("torque_rate_over_fraction", "saturated_fraction")


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A run of a candidate, as far as tuning needs it.

    Attributes:
        scenario: Name of the scenario.
        seed: Its seed.
        outcome: Name of the outcome.
        t_s: When the run ended, simulated time [s].
        detail: More about the outcome.
        metrics: Metrics by name, of several arms with the arm's name and `_` before it; None where the run
            does not define one.
    """

    scenario: str
    seed: int
    outcome: str
    t_s: float
    detail: str
    metrics: Mapping[str, float | None]

    @property
    def completed(self) -> bool:
        """Whether the task ran to its end."""
        return self.outcome == COMPLETED


def cost(trials: Iterable[Trial], weights: Weights = WEIGHTS) -> float:
    """What a candidate's runs cost; lower is better.

        c = sum over failed runs of (F + E / (1 + t / 1 s))
            + mean over completed runs of [ln(e_rcm + e_0) + ln(e_tip + e_0) + R sum_i max(0, s_i - s_0)]

    with the RMS errors e [mm], the time t at which a run ended [s], and the shares s_i of ticks in which a
    torque changes faster than its published limit, and in which one is cut at its limit. Of several arms the
    mean of their terms counts. A metric that a scenario does not define adds nothing. F, E, e_0, s_0 and R
    are `failure`, `early`, `floor_mm`, `allowed` and `rough` of `weights`.

    Source: ours; a sum of logarithms weighs ratios of errors alike, whatever their sizes.
    """
    trials = list(trials)
    failed = sum(
        weights.failure + weights.early / (1.0 + trial.t_s) for trial in trials if not trial.completed
    )
    completed = [_of_completed(trial.metrics, weights) for trial in trials if trial.completed]
    return failed + (math.fsum(completed) / len(completed) if completed else 0.0)


def _of_completed(metrics: Mapping[str, float | None], weights: Weights) -> float:
    errors = sum(
        _mean(math.log(error + weights.floor_mm) for error in _of_arms(metrics, name)) for name in ERRORS
    )
    rough = sum(
        _mean(max(0.0, share - weights.allowed) for share in _of_arms(metrics, name)) for name in SHARES
    )
    return errors + weights.rough * rough


def _of_arms(metrics: Mapping[str, float | None], name: str) -> list[float]:
    """The values of a metric that are defined: one, or of several arms one for each."""
    found = [value for key, value in metrics.items() if key == name or key.endswith(f"_{name}")]
    return [value for value in found if value is not None]


def _mean(values: Iterable[float]) -> float:
    """Their mean; 0 of none."""
    found = list(values)
    return math.fsum(found) / len(found) if found else 0.0
