"""`surgsim external`."""

import argparse

KINDS = ("header", "layout")
HELP = "print what is exchanged with a controller outside surgsim"
EXAMPLES = """A controller of your own, a process or a C function, is asked at every tick. The header is for C
and C++, with a loop that serves a process; the layout is JSON, with every field's offset, for other
languages.

examples:
  surgsim external header > surgsim_external.h
  surgsim external layout > layout.json
  surgsim run circle_lwr4plus --controller external_torque --external mine=./my_controller
  surgsim run circle_lwr4plus --controller external_torque --external mine=./libmine.so:my_torque
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("kind", choices=KINDS, metavar="KIND", help=" or ".join(KINDS))


def execute(options: argparse.Namespace) -> int:
    """Print the header, or the layout."""
    import json

    from surgsim.control.external.texts import header_text, layout_json

    if options.kind == "header":
        print(header_text(), end="")
    else:
        print(json.dumps(layout_json(), indent=2))
    return 0
