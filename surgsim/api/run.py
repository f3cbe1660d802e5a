"""A finished run, as Python sees it."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from surgsim.api.metrics import Metrics
from surgsim.display import WIDTH, html_title
from surgsim.errors import RecordingError, SurgsimError
from surgsim.metrics.catalog import of_one_arm
from surgsim.packages import require
from surgsim.recording.contents import check_contents
from surgsim.recording.read import read_recording
from surgsim.recording.sealed import read_sealed
from surgsim.scenario.arms import ArmsScenario, Experiment
from surgsim.scenario.load import load_experiment
from surgsim.scenario.schema import Scenario
from surgsim.trace.trace import Trace
from surgsim.verdict import Held, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NEEDED = ("scenario", "controller", "seed", "outcome", "success", "success_reason", "thresholds", "metrics")


class Run:
    """A run that has ended: how it went, its figures, and what they come from.

    `surgsim.run` makes one, `surgsim.read` reads one. What a folder holds is read when it is asked for.

    Args:
        summary: What `metrics.json` holds.
        scenario: The resolved scenario; None: read it from the folder or the trace.
        trace: The trace; None: read it from the recording.
        folder: The run's folder; None for a run in memory or a lone recording.
        keeper: What the folder lives as long as; held here, so that it lives as long as the run.

    Example:
        >>> import surgsim
        >>> run = surgsim.run("circle_lwr4plus", seed=3, task={"duration_s": 2.0})
        >>> run.outcome, run.scenario.seed, run.folder is None
        ('completed', 3, True)
        >>> float(run.trace["rcm_error_m"].max()) < 0.05
        True
    """

    def __init__(
        self,
        summary: Mapping[str, Any],
        *,
        scenario: Experiment | None = None,
        trace: Trace | None = None,
        folder: Path | None = None,
        keeper: object = None,
    ) -> None:
        self._summary = summary
        self._scenario = scenario
        self._trace = trace
        self.folder = folder
        self._keeper = keeper

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return str(self._summary["scenario"])

    @property
    def controller(self) -> str:
        """Name of the controller."""
        return str(self._summary["controller"])

    @property
    def seed(self) -> int:
        """The seed."""
        return int(self._summary["seed"])

    @property
    def outcome(self) -> str:
        """How the run ended, as in `metrics.json`: `completed`, `rcm_limit` and so on."""
        return str(self._summary["outcome"]["name"])

    @property
    def success(self) -> bool | None:
        """Whether the task was done; None where that is not defined."""
        return self.verdict.success

    @cached_property
    def verdict(self) -> Verdict:
        """Whether the task was done and why, and the thresholds that the run was held against."""
        keys = ("metric", "value", "most", "source")
        held = (Held(**{key: one[key] for key in keys}) for one in self._summary["thresholds"])
        return Verdict(
            success=self._summary["success"],
            reason=str(self._summary["success_reason"]),
            thresholds=tuple(held),
        )

    @property
    def ended(self) -> str:
        """How and when it ended, as a sentence, with what was seen."""
        found = self._summary["outcome"]
        detail = f" {found['detail']}." if found["detail"] else ""
        return f"{self.outcome} at {found['t_s']:.3f} s: {found['sentence']}{detail}"

    @cached_property
    def metrics(self) -> Metrics:
        """The metrics by name; None where the run does not define one."""
        return Metrics(self._summary["metrics"])

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Where the figures come from: versions, commit, machine; empty for a lone recording."""
        found: Mapping[str, Any] = self._summary["provenance"]
        return found

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario with every default.

        Raises:
            ScenarioError: If that of the folder does not load in this installation.
            SurgsimError: If it has several arms: each of `arms` has a scenario of its own.
        """
        found = self._experiment
        if isinstance(found, ArmsScenario):
            raise SurgsimError(f"{self.name} has several arms: ask for arms['{found.names[0]}'].scenario")
        return found

    @cached_property
    def _experiment(self) -> Experiment:
        if self._scenario is not None:
            return self._scenario
        source: Any = self.trace.meta.scenario if self.folder is None else self.folder / "scenario.yaml"
        return load_experiment(source)

    @cached_property
    def arms(self) -> Mapping[str, "Run"]:
        """Of several arms each one's part as a run of its own, by the arm's name; else empty."""
        whole = self._experiment if "arms" in self._summary else None
        if not isinstance(whole, ArmsScenario):
            return {}
        return {
            arm: Run(
                {**self._summary, **told, "metrics": of_one_arm(self._summary["metrics"], arm), "arms": {}},
                scenario=whole.of(arm),
                trace=self.trace.of(arm),
            )
            for arm, told in self._summary["arms"].items()
        }

    @cached_property
    def trace(self) -> Trace:
        """Every control tick.

        Raises:
            RecordingError: If the run was not recorded, or the recording is damaged.
        """
        if self._trace is not None:
            return self._trace
        if self.folder is None or not (self.folder / "recording.rrd").is_file():
            again = f"surgsim.run({str(self.folder / 'scenario.yaml')!r})" if self.folder else "surgsim.run"
            raise RecordingError(
                f"{self.folder}: was not recorded, so it has no trace. {again} makes it again."
            )
        return read_recording(self.folder).trace

    def figure(self) -> "Figure":
        """A matplotlib figure of the tip's path and of the errors over time.

        Raises:
            RecordingError: If the run was not recorded, or the recording is damaged.
            SurgsimError: If matplotlib is not installed, or the run has several arms: each of `arms` has one.

        Example:
            >>> import surgsim
            >>> figure = surgsim.run("circle_lwr4plus", task={"duration_s": 2.0}).figure()
            >>> [axes.get_ylabel() for axes in figure.axes]
            ['y [mm]', 'tip error [mm]', 'RCM error [mm]']
        """
        if self.trace.arms:
            raise SurgsimError(f"{self.name} has several arms: ask for arms['{self.trace.arms[0]}'].figure()")
        require("figures need", "matplotlib")
        from surgsim.api.figure import figure_of  # matplotlib takes a while to import

        return figure_of(self)

    def __repr__(self) -> str:
        said = [fill(text, WIDTH, break_long_words=False) for text in (self.verdict.line(), self.ended)]
        return "\n".join([self._title, *said, "", repr(self.metrics)])

    def _repr_html_(self) -> str:
        return html_title(self._title, self.verdict.line(), self.ended) + self.metrics._repr_html_()

    @property
    def _title(self) -> str:
        return f"{self.name}, {self.controller}, seed {self.seed}"


def read_run(folder: Path, keeper: object = None) -> Run:
    """The run in a folder; `keeper` is what the folder lives as long as, if that is not for ever.

    Raises:
        RecordingError: If it is none, a file of it is not as it was written, or another version wrote it.
    """
    file = folder / "metrics.json"
    if not file.is_file():
        raise RecordingError(f"{folder} is no run's folder: it holds no metrics.json")
    check_contents(folder)
    summary = read_sealed(file)
    if missing := [key for key in _NEEDED if key not in summary]:
        raise RecordingError(f"{file} is not a run's metrics.json: it has no '{missing[0]}'")
    return Run(summary, folder=folder, keeper=keeper)
