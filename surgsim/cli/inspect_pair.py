"""Two runs beside each other, for `surgsim inspect A B`."""

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surgsim.recording.read import Recorded
    from surgsim.trace.trace import Trace

    Values = Mapping[str, float | None]

_LONGEST_VALUE = 40
_KINDS = ("type", "name")


def inspect_two(paths: list[Path], options: argparse.Namespace) -> int:
    """Print how two recorded runs differ, and write or show both on one timeline if that is asked for.

    Raises:
        SurgsimError: If one is not recorded, the two have other arms, or the disk refuses.
    """
    from surgsim.cli.table import print_prose
    from surgsim.errors import SurgsimError
    from surgsim.recording import view
    from surgsim.recording.read import read_recording
    from surgsim.recording.side_by_side import write_pair

    if options.export:
        raise SurgsimError("--export takes one recording")
    pair = [read_recording(path) for path in paths]
    one, other = (_named_arms(recorded.trace.arms) for recorded in pair)
    if one != other:
        raise SurgsimError(
            f"{paths[0]} is a run of {one}, {paths[1]} of {other}: two runs side by side have the same arms; "
            "inspect each by itself"
        )
    _print_pair(paths, pair, as_json=options.json)
    if not (options.view or options.web or options.out):
        return 0
    file = options.out or Path("runs") / "pair.rrd"
    file.parent.mkdir(parents=True, exist_ok=True)
    write_pair(file, pair)
    print_prose(f"wrote {file}", sys.stderr)
    if options.view:
        view.view(file)
    elif options.web:
        view.serve(file)
    return 0


def _print_pair(paths: list[Path], pair: "list[Recorded]", as_json: bool) -> None:
    from surgsim.cli.table import print_prose, print_table
    from surgsim.metrics.catalog import compute_metrics, of_one_arm

    a, b = (compute_metrics(recorded.trace) for recorded in pair)
    gaps = {name: _minus(b[name], a[name]) for name in a}
    scenarios = [recorded.trace.meta.scenario for recorded in pair]
    changed = list(differing(scenarios[0], scenarios[1]))
    if as_json:
        settings = {key: {"a": old, "b": new} for key, old, new in changed}
        print(json.dumps({"a": a, "b": b, "b_minus_a": gaps, "settings": settings}, indent=2))
        return
    for side, path in zip("ab", paths, strict=True):
        print_prose(f"{side}: {path}")
    print()
    if changed:
        rows = [(key, _shown(old), _shown(new)) for key, old, new in changed]
        print_table("What differs", ("setting", "a", "b"), rows)
    else:
        print("The scenarios are the same.")
    print()
    one, other = (recorded.trace for recorded in pair)
    if not one.arms:
        _print_metrics("", a, b, gaps, one, other)
    for arm in one.arms:
        first, second, minus = (of_one_arm(values, arm) for values in (a, b, gaps))
        _print_metrics(arm, first, second, minus, one.of(arm), other.of(arm))


def _print_metrics(arm: str, a: "Values", b: "Values", gaps: "Values", one: "Trace", other: "Trace") -> None:
    """Metrics of an arm in both runs, and how far apart its tips were; no name where it is alone."""
    from surgsim.cli.table import print_table
    from surgsim.display import number

    shown = [name for name in a if a[name] is not None or b[name] is not None]
    table = [(name, *(number(values[name]) for values in (a, b, gaps))) for name in shown]
    of = f" of {arm}" if arm else ""
    print_table(f"Metrics{of}", ("metric", "a", "b", "b - a"), table, right=(1, 2, 3))
    largest = number(largest_gap_mm(one, other))
    print(f"\nlargest distance between the two tips{of}: {largest} mm")
    if arm:
        print()


def _named_arms(arms: Sequence[str]) -> str:
    """The arms of a run in words."""
    return f"arms {' and '.join(arms)}" if arms else "one arm"


def differing(a: Any, b: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Key paths at which two resolved scenarios differ, with both values; None where one has no such key.

    Of two parts of different type or name, that alone is said: their keys are not the same ones.
    """
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        for kind in _KINDS if path else ():
            if kind in a and kind in b and a[kind] != b[kind]:
                yield f"{path}.{kind}", a[kind], b[kind]
                return
        for key in dict.fromkeys([*a, *b]):
            yield from differing(a.get(key), b.get(key), f"{path}.{key}" if path else key)
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b) and _are_parts(a + b):
        for index, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from differing(one, other, f"{path}.{index}")
    elif a != b:
        yield path, a, b


def _are_parts(values: list[Any]) -> bool:
    return all(isinstance(value, dict) for value in values)


def _shown(value: Any) -> str:
    """A value as in a scenario, or its first words or numbers if it is long."""
    text = "-" if value is None else value if isinstance(value, str) else json.dumps(value)
    beginning = text[:_LONGEST_VALUE].rpartition(" ")[0] if len(text) > _LONGEST_VALUE else ""
    return f"{beginning} ..." if beginning else text


def _minus(b: float | None, a: float | None) -> float | None:
    return None if a is None or b is None else b - a


def largest_gap_mm(a: "Trace", b: "Trace") -> float | None:
    """Largest distance of the tips [mm], over the ticks that both have and where both are finite."""
    ticks = min(len(a), len(b))
    gap = a.block("tip")[:ticks] - b.block("tip")[:ticks]
    distances = (math.hypot(*row) for row in gap.tolist())
    found = max((d for d in distances if math.isfinite(d)), default=None)
    return None if found is None else 1e3 * found
