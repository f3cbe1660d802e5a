"""What a tuning is asked for, what it tried, and what it found."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from surgsim.compare.job import BROKEN
from surgsim.control.controller import ControllerConfig
from surgsim.scenario.arms import Experiment
from surgsim.tuning.cost import Trial
from surgsim.tuning.gains import Gain, Values, with_values


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What is to be tuned, and on what.

    Attributes:
        controller: A shipped name or a path.
        scenarios: Shipped or drawn names, or paths.
        seeds: Tuning seeds, such as `1000:1003`.
        budget: Runs that the search may take.
        keys: Places of the gains in the controller's file; None: all of torque law and resolver.
        settings: `key.path=value` of every run.
        seed: Of the optimiser.
    """

    controller: str
    scenarios: tuple[str, ...]
    seeds: str
    budget: int
    keys: tuple[str, ...] | None = None
    settings: tuple[str, ...] = ()
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """Gains that were tried.

    Attributes:
        number: How many were tried before; 0 is the controller as it is.
        values: The gains by their place.
        trials: Its runs, in the order of scenarios and seeds.
        cost: What they cost.
    """

    number: int
    values: Values
    trials: tuple[Trial, ...]
    cost: float


@dataclass(frozen=True, kw_only=True)
class Margins:
    """How far gains are from a run that does not complete; None where that cannot be asked.

    Attributes:
        delay_s: Largest extra actuation delay with which all runs complete [s].
        delay_most_s: Largest that was tried [s].
        gain_factor: Largest factor on all tuned gains with which all runs complete.
        gain_most: Largest that was tried.
        runs: How many runs that took.
    """

    delay_s: float | None
    delay_most_s: float
    gain_factor: float | None
    gain_most: float
    runs: int


@dataclass(kw_only=True)
class Tuning:
    """A tuning on its way, and what it found.

    Attributes:
        wish: What was asked for.
        scenarios: The runs of the controller as it is, one for each scenario and seed; it drives every arm.
        controller: The controller as it is.
        gains: What is searched.
        tried: All candidates, in their order; the first is the controller as it is.
        margins: Those of the best one, once they are measured.
    """

    wish: Wish
    scenarios: Sequence[Experiment]
    controller: ControllerConfig
    gains: Sequence[Gain]
    tried: list[Candidate] = field(default_factory=list)
    margins: Margins | None = None

    @property
    def name(self) -> str:
        """What the tuned controller is called."""
        return f"{self.controller.name}_tuned"

    @property
    def scenario_names(self) -> list[str]:
        """Names of the scenarios, in their order."""
        return list(dict.fromkeys(scenario.name for scenario in self.scenarios))

    @property
    def start(self) -> Values:
        """The controller's own gains, to the last digit."""
        return {gain.key: gain.start if gain.listed else gain.start[0] for gain in self.gains}

    @property
    def before(self) -> Candidate:
        """The controller as it is."""
        return self.tried[0]

    @property
    def best(self) -> Candidate:
        """The first of those that cost least."""
        return min(self.tried, key=lambda candidate: candidate.cost)

    @property
    def runs(self) -> int:
        """How many runs the search has taken."""
        return sum(len(candidate.trials) for candidate in self.tried)

    @property
    def budgeted(self) -> int:
        """How many it will take: whole candidates alone."""
        return self.wish.budget // len(self.scenarios) * len(self.scenarios)

    @property
    def broken(self) -> list[Trial]:
        """Runs that crashed or lost their worker."""
        return [trial for candidate in self.tried for trial in candidate.trials if trial.outcome in BROKEN]

    def tuned(self, values: Values | None = None) -> ControllerConfig:
        """The controller with other gains, by default the best.

        Raises:
            ScenarioError: If a part refuses them.
        """
        return with_values(self.controller, self.best.values if values is None else values, self.name)


def means(trials: Sequence[Trial], scenario: str) -> Mapping[str, float | None]:
    """Mean of every metric over the runs of a scenario that completed, and how many failed."""
    runs = [trial for trial in trials if trial.scenario == scenario]
    completed = [trial.metrics for trial in runs if trial.completed]
    found: dict[str, float | None] = {"failed_runs": float(len(runs) - len(completed))}
    for name in completed[0] if completed else ():
        values = [value for metrics in completed if (value := metrics[name]) is not None]
        found[name] = math.fsum(values) / len(values) if values else None
    return found
