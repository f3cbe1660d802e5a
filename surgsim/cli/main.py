"""Entry point: parses the command line and runs one command.

Exit status: 0 done; 1 the run ended with an outcome other than completed, or figures differ; 2 the user's
input is wrong; 128 and the signal's number if one ended the command (Ctrl-C 130, SIGTERM 143).
"""

import argparse
import importlib
import io
import os
import sys
from collections.abc import Sequence

from surgsim import __version__
from surgsim.cli.kernels import compiling_shown
from surgsim.cli.parser import Parser
from surgsim.cli.scenario_options import externals_given
from surgsim.cli.table import print_prose
from surgsim.errors import SurgsimError
from surgsim.packages import missing
from surgsim.runs.stop import Stopped, stopping_in_order

COMMANDS = (
    "run",
    "check",
    "list",
    "compare",
    "tune",
    "score",
    "seeds",
    "submit",
    "verify",
    "protocol",
    "report",
    "inspect",
    "export",
    "reproduce",
    "bench",
    "adopt",
    "external",
    "test-part",
    "completion",
)
_LONGEST_ERROR = 1000
_EPILOG = """examples:
  surgsim run circle_lwr4plus          run a shipped scenario
  surgsim run my.yaml --set task.radius_m=0.03
                                       run your own, with one value changed
  surgsim check my.yaml                say what is wrong with it
  surgsim list controllers             what can be named in a scenario
  surgsim compare quick                scenarios, controllers and seeds
  surgsim tune vprnn --scenario circle_panda --budget 300
                                       better gains for a controller
  surgsim score rcm_inverse_dynamics   a controller through the frozen protocol
  surgsim verify mine.zip              somebody's score, checked and run again
  surgsim inspect runs/circle_lwr4plus/vprnn-seed0 --view
"""


def build_parser() -> argparse.ArgumentParser:
    """The whole command line; imports nothing heavy."""
    parser = Parser(
        prog="surgsim",
        description="Benchmark for controllers that move a surgical instrument through a trocar.",
        epilog=_EPILOG,
    )
    parser.add_argument("--version", action="version", version=f"surgsim {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = importlib.import_module(f"surgsim.cli.{name.replace('-', '_')}")
        sub = commands.add_parser(
            name,
            help=module.HELP,
            description=module.HELP[0].upper() + module.HELP[1:] + ".",
            epilog=module.EXAMPLES,
        )
        module.add_arguments(sub)
        sub.set_defaults(execute=module.execute)
    return parser


def print_error(error: SurgsimError) -> None:
    """Print what the user can mend on one line of stderr, whatever the names in it.

    A terminal breaks it between words.
    """
    from surgsim.scenario.messages import one_line

    print_prose(f"surgsim: {one_line(str(error), _LONGEST_ERROR)}", sys.stderr)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    _replace_what_cannot_be_shown()
    try:
        with stopping_in_order(), compiling_shown():
            options = build_parser().parse_args(arguments)
            with externals_given(options):
                return int(options.execute(options))
    except SurgsimError as error:
        print_error(error)
        return 2
    except ModuleNotFoundError as error:
        if (told := missing(error)) is None:
            raise
        print_error(told)
        return 2
    except Stopped as stopped:
        print(f"surgsim: {stopped.told}; nothing half done is left", file=sys.stderr)
        return stopped.exit_status
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _replace_what_cannot_be_shown() -> None:
    """Let a terminal that does not know a letter show a question mark, rather than end the command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
