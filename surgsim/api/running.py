"""`surgsim.run`."""

import os
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from surgsim.api.run import Run
from surgsim.cli.output import show_progress
from surgsim.cli.scenario_options import naming_file
from surgsim.control.controller import ControllerConfig
from surgsim.errors import UnreachableError
from surgsim.runs.folder import execute, run_to_folder, summary_of_result
from surgsim.runs.part_origins import check_parts
from surgsim.scenario.arms import Experiment
from surgsim.scenario.externals import externals_given
from surgsim.scenario.load import Source, load_experiment
from surgsim.scenario.plain import assignments_of
from surgsim.simulate.loop import Progress


def run(
    scenario: Source | Experiment,
    /,
    *,
    controller: Source | ControllerConfig | None = None,
    seed: int | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | os.PathLike[str] | None = None,
    record: bool = True,
    progress: bool = False,
    externals: Mapping[str, str] | None = None,
    **blocks: Any,
) -> Run:
    """Run a scenario, in memory unless `out` is given.

    Args:
        scenario: Name of a shipped scenario, path of a YAML file, its content as a mapping, or a scenario.
        controller: Controller instead of the scenario's own: a name, a path, or its content as a mapping.
        seed: Seed instead of the scenario's own.
        settings: Values by key path, as `--set` of the command: `{"disturbances.0.mass_kg": 0.3}`.
        out: Folder to write, the same as the command writes; None: nothing is written.
        record: Whether that folder holds a recording.
        progress: Whether standard error shows how far the run is.
        externals: Commands of controllers outside surgsim by name, as `--external` of the command.
        **blocks: Values by a scenario's top-level key, see `surgsim.load`.

    Returns:
        The run, also one that a limit stopped; its `outcome` tells.

    Raises:
        SurgsimError: If the scenario is not valid or cannot be started, or the folder cannot be written.

    Example:
        >>> import surgsim
        >>> run = surgsim.run("circle_lwr4plus", controller="pinv", task={"duration_s": 2.0})
        >>> run.outcome, run.metrics["tip_error_rms_mm"] < 1.0
        ('completed', True)
    """
    assignments = assignments_of(blocks, settings)
    checked = load_experiment(scenario, controller=controller, assignments=assignments, seed=seed)
    folder = None if out is None else Path(out)
    with externals_given(externals or {}):
        check_parts([checked])
        try:
            with _shown(checked, progress) as report:
                if folder is None:
                    result = execute(checked, report)
                else:
                    result = run_to_folder(checked, folder, record=record, progress=report)
        except UnreachableError as error:
            if isinstance(scenario, str | os.PathLike):
                raise naming_file(os.fspath(scenario), error) from error
            raise
        summary = summary_of_result(checked, result)
    return Run(summary, scenario=checked, trace=result.trace, folder=folder)


def _shown(scenario: Experiment, progress: bool) -> AbstractContextManager[Progress | None]:
    """The command's progress, or none."""
    return show_progress(f"{scenario.name} {scenario.controller_name}") if progress else nullcontext()
