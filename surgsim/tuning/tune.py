"""The runs that a search asks for, and what it makes of them."""

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.errors import ScenarioError
from surgsim.scenario.arms import Experiment
from surgsim.scenario.load import load_experiment
from surgsim.tuning.cost import cost
from surgsim.tuning.gains import Values
from surgsim.tuning.search import minimise
from surgsim.tuning.trials import Case, Report, RunJobs, Trials
from surgsim.tuning.tuning import Candidate, Tuning

EVALUATIONS = "evaluations.jsonl"


@contextmanager
def trials_in(folder: Path, workers: AbstractContextManager[RunJobs]) -> Iterator[Trials]:
    """The runs that a folder keeps; what a run writes meanwhile is elsewhere, and removed."""
    with tempfile.TemporaryDirectory(prefix="surgsim-tune-") as aside, workers as run_jobs:
        yield Trials(folder / EVALUATIONS, Path(aside), run_jobs)


def search(tuning: Tuning, trials: Trials, report: Report) -> None:
    """Spend the budget; the candidates are in `tuning.tried`, also if this is interrupted."""

    def costs_of(positions: Sequence[Array]) -> list[float]:
        first = len(tuning.tried)
        values = [_values(tuning, x) if tuning.tried else tuning.start for x in positions]
        cases = [list(cases_of(tuning, first + i, each)) for i, each in enumerate(values)]
        found = iter(trials.of([case for some in cases for case in some], report))
        for i, (each, some) in enumerate(zip(values, cases, strict=True)):
            runs = tuple(next(found) for _ in some)
            tuning.tried.append(Candidate(number=first + i, values=each, trials=runs, cost=cost(runs)))
        return [candidate.cost for candidate in tuning.tried[first:]]

    low, high = np.array([gain.positions for gain in tuning.gains]).T
    candidates = tuning.wish.budget // len(tuning.scenarios)
    minimise(costs_of, low, high, candidates=candidates, seed=tuning.wish.seed)


def _values(tuning: Tuning, x: Array) -> Values:
    """The gains at a position of the search (n,)."""
    return {gain.key: gain.at(float(place)) for gain, place in zip(tuning.gains, x, strict=True)}


def cases_of(tuning: Tuning, number: int, values: Values, delay_s: float = 0.0) -> Iterator[Case]:
    """The runs of a candidate on every scenario and seed, perhaps with torques that come so much later [s].

    The controller as it is keeps its name, so that its runs are those that a person has seen.
    """
    told: dict[str, Any] = {"candidate": number, "gains": dict(values), "extra_delay_s": delay_s}
    for base in tuning.scenarios:
        try:
            own = values == tuning.start
            scenario = base if own else load_experiment(base, controller=tuning.tuned(values))
            if delay_s > 0.0:
                scenario = with_delay(scenario, delay_s)
        except ScenarioError as error:
            yield Case(scenario=None, name=base.name, seed=base.seed, told=told, refusal=str(error))
        else:
            yield Case(scenario=scenario, name=base.name, seed=base.seed, told=told)


def with_delay(scenario: Experiment, delay_s: float) -> Experiment:
    """`scenario` with torques that come so much later than they do there [s], of every arm."""
    tree = scenario.resolved()
    tree["disturbances"].append({"type": "actuation_delay", "delay_s": delay_s})
    return load_experiment(tree)
