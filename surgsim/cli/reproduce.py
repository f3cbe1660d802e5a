"""`surgsim reproduce`."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.cli.paths import path_argument

if TYPE_CHECKING:
    from surgsim.studies.engine import StudyResult

HELP = "make a paper's tables and figures again and check its claims"
EXAMPLES = """Tables go to CSV and Markdown, figures to PNG; README.md in the folder explains them. The folder
appears when the study is whole; the same command goes on with one that was interrupted. A claim that does
not hold is a result, not an error: the exit status is 0.

examples:
  surgsim reproduce manipulability_validation
  surgsim reproduce manipulability_validation --quick --out /tmp/sample
  surgsim reproduce manipulability_validation --json | jq .claims
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from surgsim.studies import STUDIES

    parser.add_argument("study", metavar="STUDY", help=", ".join(sorted(STUDIES)))
    parser.add_argument(
        "--out",
        type=path_argument,
        metavar="DIR",
        help="the result folder, by default results/STUDY; replaced if it exists",
    )
    parser.add_argument("--quick", action="store_true", help="a sample of the runs, no figures")
    parser.add_argument("--json", action="store_true", help="print claims and tables as JSON")


def execute(options: argparse.Namespace) -> int:
    """Run the study, write its folder, print the main table and every claim."""
    from surgsim.runs.folder import whole_folder
    from surgsim.studies import load_study
    from surgsim.studies.engine import run_study
    from surgsim.studies.kept import kept_until_whole

    study = load_study(options.study)
    folder = options.out or Path("results") / (f"{options.study}_quick" if options.quick else options.study)
    _check_target(folder)
    with kept_until_whole(folder) as kept, whole_folder(folder) as draft:
        result = run_study(study, draft, options.quick, _say, kept)
    if options.json:
        _print_json(options.study, result)
    else:
        _print(options.study, result)
    _say(f"wrote {folder}")
    return 0


def _check_target(folder: Path) -> None:
    """Refuse to replace anything but a study's folder."""
    from surgsim.errors import SurgsimError

    if folder.exists() and not folder.is_dir():
        raise SurgsimError(f"{folder} is a file; --out names a folder")
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    page = folder / "README.md"
    is_study = page.is_file() and "surgsim reproduce" in page.read_text(encoding="utf-8", errors="replace")
    foreign = [name for name in names if Path(name).suffix not in (".csv", ".png", ".md")]
    if foreign or (names and not is_study):
        raise SurgsimError(
            f"{folder} holds '{min(foreign or names)}', which is not a study's; choose another --out"
        )


def _say(line: str) -> None:
    from surgsim.cli.table import print_prose

    print_prose(line, sys.stderr)


def _print_json(study: str, result: "StudyResult") -> None:
    import json
    from dataclasses import asdict

    claims = [asdict(claim) for claim in result.claims]
    tables = {name: list(rows) for name, rows in result.tables.items()}
    print(json.dumps({"study": study, "claims": claims, "tables": tables, "files": result.files}, indent=2))


def _print(study: str, result: "StudyResult") -> None:
    from surgsim.cli.table import print_beside, print_table
    from surgsim.studies.tables import format_cell

    name, rows = next(iter(result.tables.items()))
    header = list(rows[0])
    numeric = [i for i, key in enumerate(header) if not isinstance(rows[0][key], str)]
    cells = [[format_cell(row[key], column=key) for key in header] for row in rows]
    print_table(f"{study}: {name}", [key.replace("_", " ") for key in header], cells, right=numeric)
    print()
    for claim in result.claims:
        print_beside(f"{claim.verdict:14} ", f"{claim.text} ({claim.source})", claim.evidence)
