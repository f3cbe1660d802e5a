"""Reproductions of the papers: each study is a package with `run(out, quick, progress) -> StudyResult`."""

import importlib

from surgsim.errors import SurgsimError, unknown_name
from surgsim.studies.study import RunStudy

STUDIES: dict[str, str] = {
    "manipulability_validation": "surgsim.studies.manipulability_validation",
    "passive_teleoperation": "surgsim.studies.passive_teleoperation",
    "vprnn": "surgsim.studies.vprnn",
}
"""Name of each study, and the module that is imported when it is run."""


def load_study(name: str) -> RunStudy:
    """The `run` of a study.

    Raises:
        SurgsimError: If there is no such study.
    """
    if name not in STUDIES:
        raise SurgsimError(unknown_name(name, "study", STUDIES))
    run: RunStudy = importlib.import_module(STUDIES[name]).run
    return run
