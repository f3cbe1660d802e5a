"""`surgsim protocol`."""

import argparse

HELP = "show a protocol, check that it is what its name says, or freeze it"
EXAMPLES = """A protocol is frozen: scenarios, assets, metrics, thresholds and the way figures are taken are
hashed under its name, and what changed is refused. A change gets a name of its own, and the old protocol
stays as it is. While a protocol is a draft, it may be frozen again.

examples:
  surgsim protocol show
  surgsim protocol check
  surgsim protocol freeze surgsim_v1
  surgsim protocol freeze surgsim_v2 --from surgsim_v1
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("action", choices=("show", "check", "freeze"), help="what is to be done")
    parser.add_argument("protocol", nargs="?", metavar="NAME", help="name or .yaml file; default: surgsim_v1")
    parser.add_argument("--from", dest="source", metavar="NAME", help="whose definition a new one copies")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Show, check or freeze; `check` gives 1 if something changed."""
    from surgsim.errors import SurgsimError
    from surgsim.protocol.definition import CURRENT, load_protocol

    if options.source is not None and (options.action != "freeze" or options.protocol is None):
        raise SurgsimError("--from is for: surgsim protocol freeze NEW_NAME --from NAME")
    if options.source is not None:
        return _freeze_as(options)
    protocol = load_protocol(options.protocol or CURRENT)
    return {"show": _show, "check": _check, "freeze": _freeze}[options.action](protocol, options.json)


def _freeze_as(options: argparse.Namespace) -> int:
    from surgsim.protocol.definition import load_protocol
    from surgsim.protocol.freeze import freeze_as

    protocol, sha256 = freeze_as(load_protocol(options.source), options.protocol)
    _tell({"protocol": protocol.name, "sha256": sha256, "file": str(protocol.path)}, options.json)
    return 0


def _freeze(protocol, as_json: bool) -> int:  # type: ignore[no-untyped-def]
    from surgsim.protocol.freeze import freeze

    sha256, changed = freeze(protocol)
    _tell({"protocol": protocol.name, "sha256": sha256, "changed": changed}, as_json)
    return 0


def _check(protocol, as_json: bool) -> int:  # type: ignore[no-untyped-def]
    from surgsim.protocol.freeze import changed_items, frozen_sha256

    changed = changed_items(protocol)
    _tell({"protocol": protocol.name, "sha256": frozen_sha256(protocol), "changed": changed}, as_json)
    return 1 if changed else 0


def _show(protocol, as_json: bool) -> int:  # type: ignore[no-untyped-def]
    import json

    from surgsim.cli.table import print_prose, print_table
    from surgsim.protocol.seeds import read_rounds

    config = protocol.config
    rounds = read_rounds(protocol)
    if as_json:
        print(json.dumps({**config.model_dump(mode="json"), "rounds": rounds}, indent=2))
        return 0
    print_prose(f"{config.name}{' (draft)' if config.draft else ''}: {config.description}")
    tracks = [(name, track.description, ", ".join(track.generators)) for name, track in config.tracks.items()]
    print_table("\nTracks", ("track", "what a controller may know", "generators"), tracks)
    counts = [
        (name, generator.description, str(generator.seeds), str(_points(generator)))
        for name, generator in config.generators.items()
    ]
    heading = ("generator", "what", "runs", "at levels")
    print_table("\nRuns of each arm", heading, counts, right=(2, 3))
    opened = [
        (name, "open" if entry["key"] else "closed", entry["key_sha256"]) for name, entry in rounds.items()
    ]
    if opened:
        print_table("\nRounds", ("round", "state", "hash of its key"), opened)
    return 0


def _points(generator) -> int:  # type: ignore[no-untyped-def]
    return sum(len(axis.levels) for axis in generator.axes.values()) * int(generator.level_seeds)


def _tell(told, as_json: bool) -> None:  # type: ignore[no-untyped-def]
    import json

    from surgsim.cli.table import print_prose

    if as_json:
        print(json.dumps(told, indent=2))
        return
    print_prose(f"{told['protocol']}  {told['sha256']}")
    if "file" in told:
        print_prose(f"wrote {told['file']} and its lock")
    for name in told.get("changed", ()):
        print_prose(f"changed: {name}")
