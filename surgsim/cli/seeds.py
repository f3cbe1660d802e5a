"""`surgsim seeds`."""

import argparse

from surgsim.cli.paths import path_argument

HELP = "fix the seeds of a round before it, and open them"
EXAMPLES = """The seeds of a round derive from a phrase. `commit` writes the hash of the round's key, which is
published before the round; `open` checks the phrase and writes the key, from which anybody derives the seeds.
The phrase itself is asked for, or read from a file, and written nowhere.

examples:
  surgsim seeds commit --round 2027-1
  surgsim seeds open --round 2027-1 --phrase-file ~/phrase.txt
  surgsim seeds show --round 2027-1
  surgsim seeds show --round development --generator random
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("action", choices=("commit", "open", "show"), help="what is to be done")
    parser.add_argument("--round", required=True, metavar="R", help="name of the round")
    parser.add_argument("--protocol", metavar="NAME", help="name or .yaml file; default: surgsim_v1")
    parser.add_argument("--phrase-file", type=path_argument, metavar="FILE", help="file of the phrase")
    parser.add_argument("--generator", metavar="NAME", help="show the seeds of this generator alone")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Commit, open or show a round."""
    from surgsim.protocol.definition import CURRENT, load_protocol
    from surgsim.protocol.seeds import commit_round, open_round, seeds_of

    protocol = load_protocol(options.protocol or CURRENT)
    if options.action == "commit":
        found = commit_round(protocol, options.round, _phrase(options, twice=True))
        told = {"protocol": protocol.name, "round": options.round, "key_sha256": found}
        _print(told, f"{found}\nPublish this hash with the round; it is in {protocol.rounds}.", options.json)
        return 0
    if options.action == "open":
        seeds = open_round(protocol, options.round, _phrase(options, twice=False))
    else:
        seeds = seeds_of(protocol, options.round)
    _print_seeds(protocol, seeds, options)
    return 0


def _print_seeds(protocol, seeds, options: argparse.Namespace) -> None:  # type: ignore[no-untyped-def]
    from surgsim.errors import SurgsimError, unknown_name

    generators = protocol.config.generators
    if options.generator is not None and options.generator not in generators:
        raise SurgsimError(f"--generator: {unknown_name(options.generator, 'generator', generators)}")
    names = [options.generator] if options.generator else list(generators)
    found = {
        name: list(seeds.of(name, max(generators[name].seeds, generators[name].level_seeds)))
        for name in names
    }
    lines = [f"{name}: {', '.join(map(str, numbers))}" for name, numbers in found.items()]
    _print({**seeds.told(), "seeds": found}, "\n".join(lines), options.json)


def _print(told, text: str, as_json: bool) -> None:  # type: ignore[no-untyped-def]
    import json

    from surgsim.cli.table import print_prose

    if as_json:
        print(json.dumps(told, indent=2))
        return
    for line in text.splitlines():
        print_prose(line)


def _phrase(options: argparse.Namespace, *, twice: bool) -> str:
    """The phrase, from the file, or asked for without showing it; `twice` against a slip."""
    import getpass
    import sys

    from surgsim.errors import SurgsimError

    if options.phrase_file is not None:
        try:
            return str(options.phrase_file.read_text(encoding="utf-8")).strip()
        except (OSError, ValueError) as error:
            raise SurgsimError(f"--phrase-file: {options.phrase_file}: {error}") from error
    if not sys.stdin.isatty():
        raise SurgsimError("the phrase is asked for on a terminal; give --phrase-file FILE elsewhere")
    phrase = getpass.getpass("phrase: ")
    if twice and getpass.getpass("again: ") != phrase:
        raise SurgsimError("these were two different phrases")
    return phrase
