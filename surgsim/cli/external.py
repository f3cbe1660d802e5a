"""`surgsim external`."""

import argparse

KINDS = ("header", "layout", "python")
HELP = "print what is exchanged with a controller outside surgsim"
EXAMPLES = """A controller of your own, a process or a C function, is asked at every tick. The header is for C
and C++, with a loop that serves a process; the layout is JSON, with every field's offset, for other
languages. Python has a reader, which serves a process by the layout beside it.

examples:
  surgsim external header > surgsim_external.h
  surgsim external layout > layout.json
  surgsim external python > surgsim_external.py
  surgsim run circle_lwr4plus --controller external_torque --external mine=./my_controller
  surgsim run circle_lwr4plus --controller external_torque --external mine=./libmine.so:my_torque
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("kind", choices=KINDS, metavar="KIND", help="header, layout or python")


def execute(options: argparse.Namespace) -> int:
    """Print the header, the layout or the reader."""
    import json

    from surgsim.control.external.texts import header_text, layout_json
    from surgsim.resources import resource_dir

    if options.kind == "header":
        print(header_text(), end="")
    elif options.kind == "python":
        reader = resource_dir("examples") / "external" / "python" / "surgsim_external.py"
        print(reader.read_text(encoding="utf-8"), end="")
    else:
        print(json.dumps(layout_json(), indent=2))
    return 0
