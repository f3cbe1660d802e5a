"""`surgsim check`."""

import argparse

from surgsim.cli.scenario_options import add_scenario_options, naming_file

HELP = "check scenarios and print them with every default"
EXAMPLES = """Checks everything short of running: the file, the start configuration, and that the path can be
reached through the trocar.

examples:
  surgsim check my_scenario.yaml
  surgsim check circle_lwr4plus --set task.radius_m=0.2
  surgsim check circle_lwr4plus spiral_lwr4plus --quiet
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("scenarios", nargs="+", metavar="SCENARIO", help="YAML files or shipped names")
    add_scenario_options(parser)
    parser.add_argument("--quiet", action="store_true", help="print only what is wrong")


def execute(options: argparse.Namespace) -> int:
    """Check every scenario; 2 if any is wrong."""
    from surgsim.cli.main import print_error
    from surgsim.cli.table import print_text
    from surgsim.errors import SurgsimError
    from surgsim.runs.part_origins import check_parts
    from surgsim.scenario.load import load_experiment
    from surgsim.scenario.yaml_text import dump_yaml
    from surgsim.simulate.loop import prepared

    wrong = 0
    for name in options.scenarios:
        try:
            scenario = load_experiment(
                name, controller=options.controller, assignments=options.assignments, seed=options.seed
            )
            check_parts([scenario])
            setup = prepared(scenario)
            setup.close()
        except SurgsimError as error:
            print_error(naming_file(name, error))
            wrong += 1
            continue
        if not options.quiet:
            print(f"# {name}: ok, {setup.duration_s:g} s")
            print(f"# sha256 {scenario.sha256()}")
            print_text(dump_yaml(scenario.resolved()))
            print("---\n" if len(options.scenarios) > 1 else "", end="")
    return 2 if wrong else 0
