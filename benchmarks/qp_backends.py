"""Two solvers of the QP resolvers, daqp and osqp unless told otherwise, on every scenario in closed loop.

    python benchmarks/qp_backends.py                       every shipped scenario, whole
    python benchmarks/qp_backends.py circle_lwr4plus       some
    python benchmarks/qp_backends.py --solvers active_set daqp

A scenario that names a QP resolver runs with its own controller, every other one with `qp`. The table holds
the largest difference between the two traces: what the same law makes of two solvers. Where the surroundings
make a small difference grow, as contacts do, that growth is part of it.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from surgsim.cli.table import print_table
from surgsim.scenario.load import load_scenario, shipped
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Trace

QP_RESOLVERS = ("qp", "passive_qp")
MEASURES = (("q", "q", 1.0, "rad"), ("tip", "tip", 1e6, "µm"), ("torque", "tau", 1.0, "N m"))


def with_solver(name: str, solver: str) -> Scenario:
    own = load_scenario(name).controller.resolver.type in QP_RESOLVERS
    setting = [f"controller.resolver.solver={solver}"]
    return load_scenario(name, controller=None if own else "qp", assignments=setting)


def row(name: str, solvers: Sequence[str]) -> list[str]:
    scenarios = [with_solver(name, solver) for solver in solvers]
    one, two = (simulate(scenario) for scenario in scenarios)
    ends = [f"{t.meta.ending.outcome.name.lower()} at {t.meta.ending.t_s:.3f} s" for t in (one, two)]
    apart = [f"{factor * difference(one, two, block):.1e}" for _, block, factor, _ in MEASURES]
    medians = [f"{1e6 * np.nanmedian(t['control_time_s']):.0f}" for t in (one, two)]
    end = ends[0] if ends[0] == ends[1] else f"{ends[0]}; {ends[1]}"
    return [name, scenarios[0].controller.resolver.type, end, *apart, " / ".join(medians)]


def difference(one: Trace, two: Trace, block: str) -> float:
    """Largest difference of a block's columns over the ticks that both runs have."""
    ticks = min(len(one["t_s"]), len(two["t_s"]))
    return float(np.nanmax(np.abs(one.block(block)[:ticks] - two.block(block)[:ticks])))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help="names; all shipped ones by default")
    parser.add_argument("--solvers", nargs=2, default=("daqp", "osqp"), help="daqp osqp by default")
    given = parser.parse_args(arguments)
    names, solvers = given.scenarios or list(shipped()), given.solvers
    header = ["scenario", "resolver", "ends", *(f"{name} [{unit}]" for name, _, _, unit in MEASURES)]
    rows = []
    for name in names:
        rows.append(row(name, solvers))
        print(" | ".join(rows[-1]), flush=True)
    one, two = solvers
    header.append(f"controller [µs], {one} / {two}")
    print_table(f"{one} against {two}", header, rows, range(3, 7), whole=True)


if __name__ == "__main__":
    main()
