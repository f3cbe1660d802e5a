"""Reproductions of papers: a study is a declaration, and one engine runs them all.

The least set of concepts, in the order in which the engine meets them:

    Paper     what is reproduced: its title, where it appeared, and every number it prints with its place
    Case      one run: a scenario, its controller and settings. It says how it is run and what is measured;
              each measure is a function of what the run gave (mostly a trace) and has a name that ends in its
              unit; curves are what the figures show of it
    table     rows that are made of measured cases, the paper's numbers beside ours
    Claim     a statement, who makes it, and the rule that judges it by the tables alone
    Figure    a file, and what is drawn in it: curves and tables against each other
    Section   a paragraph of the page, with the table and the figures that follow it
    Study     all of these: cases (and fewer for a quick run), tables, claims, figures, sections

A fourth study is one folder whose `__init__` has a `STUDY`, and a line in `STUDIES`. By custom `cases.py` has
the paper's numbers, the cases and their measures; `page.py` the figures and what is written between them;
`__init__.py` the tables, the claims and the study; and at most one more file what only this study needs,
such as a network on its own. None is longer than 300 lines.

What any study may use is beside it: measures of a trace (measures.py, stepped.py), rows compared
(compared.py), random samples and homes (samples.py, homes.py), random starts (starts.py), two stages of a
procedure (stages.py), levels of disturbance and ladders of them (levels.py), a problem held still (still.py),
a program that is timed (timed.py), and the attainable manipulability by the timing of a run (attainable.py).

`run_study` (engine.py) runs the cases in several processes, tells of progress, keeps what is measured so that
a study that was interrupted goes on, and hands over to tables, claims, figures and page. It knows no paper.
"""

import importlib
from typing import TYPE_CHECKING

from surgsim.errors import SurgsimError, unknown_name

if TYPE_CHECKING:
    from surgsim.studies.study import Study

STUDIES: dict[str, str] = {
    "bilateral_schemes": "surgsim.studies.bilateral_schemes",
    "manipulability_validation": "surgsim.studies.manipulability_validation",
    "passive_teleoperation": "surgsim.studies.passive_teleoperation",
    "vprnn": "surgsim.studies.vprnn",
}
"""Name of each study, and the module whose `STUDY` is read when it is run."""


def load_study(name: str) -> "Study":
    """The declaration of a study.

    Raises:
        SurgsimError: If there is no such study.
    """
    if name not in STUDIES:
        raise SurgsimError(unknown_name(name, "study", STUDIES))
    study: Study = importlib.import_module(STUDIES[name]).STUDY
    return study
