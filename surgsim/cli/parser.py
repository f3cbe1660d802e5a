"""The parser of the command line: help that fits the terminal, and mistakes that name what was meant."""

import argparse
import difflib
import sys
from typing import Any, NoReturn

from surgsim.cli.table import fit_prose, print_prose, terminal_width
from surgsim.errors import unknown_name

_WIDEST_HELP = 100
_MISSING = "the following arguments are required: "


class Parser(argparse.ArgumentParser):
    """A parser whose mistakes are a line of the form of every other error, below its usage."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**{"formatter_class": HelpFormatter, **settings})

    def error(self, message: str) -> NoReturn:
        """Print the usage, or the whole help where an argument is missing, then `message`; exit status 2."""
        missing = message.removeprefix(_MISSING)
        if missing == message:
            self._leave(self.format_usage(), message)
        self._leave(self.format_help(), f"{missing} is missing")

    def parse_known_args(self, args=None, namespace=None):  # type: ignore[no-untyped-def]
        """As the base class, but what is not known is refused here, where it is clear what there is."""
        found, strangers = super().parse_known_args(args, namespace)
        if strangers:
            self.error(self._stranger(strangers[0]))
        return found, strangers

    def _stranger(self, word: str) -> str:
        """That `word` is not expected, and what may have been meant."""
        if not word.startswith("-"):
            return f"'{word}' is one word too many"
        option = word.partition("=")[0]
        known = [name for action in self._actions for name in action.option_strings if name.startswith("--")]
        near = difflib.get_close_matches(option, known, n=1)
        meant = f"Did you mean '{near[0]}'?" if near else f"{self.prog} --help lists those there are."
        return f"'{option}' is not an option of {self.prog}. {meant}"

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is not among the choices, with the nearest of them."""
        if action.choices is None or value in action.choices:
            return
        kind = (
            f"value of {action.option_strings[-1]}" if action.option_strings else str(action.metavar).lower()
        )
        text = unknown_name(str(value), kind, map(str, action.choices))
        self._leave(self.format_usage() if action.option_strings else self.format_help(), text)

    def _leave(self, above: str, message: str) -> NoReturn:
        print(above, file=sys.stderr)
        print_prose(f"surgsim: {message}", sys.stderr)
        raise SystemExit(2)


class HelpFormatter(argparse.HelpFormatter):
    """Help in lines that fit the terminal; indented lines of a text, its examples, stay as they are."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=26, width=min(terminal_width(sys.stdout), _WIDEST_HELP))

    def _split_lines(self, text: str, width: int) -> list[str]:
        return fit_prose(text, width)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        lines: list[str] = []
        for paragraph in text.strip("\n").split("\n\n"):
            if any(line.startswith(" ") for line in paragraph.split("\n")):
                lines += paragraph.split("\n")
            else:
                lines += fit_prose(" ".join(paragraph.split()), width)
            lines.append("")
        return "\n".join(indent + line for line in lines[:-1])
