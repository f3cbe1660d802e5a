"""What to call runs that are shown together."""

from collections.abc import Sequence

from surgsim.export.subjects import RunSubject


def told_apart(runs: Sequence[RunSubject]) -> list[str]:
    """What is different of the runs: scenario, controller, seed; scenario and controller of one run."""
    named = [
        (scenario, controller, f"seed {seed}") for scenario, controller, seed in (run.named for run in runs)
    ]
    if len(runs) == 1:
        return [", ".join(named[0][:2])]
    parts = [part for part in range(3) if len({name[part] for name in named}) > 1] or [1]
    names = [", ".join(name[part] for part in parts) for name in named]
    if len({*names}) == len(names):
        return names
    return [f"{name} ({run.path.name})" for name, run in zip(names, runs, strict=True)]
