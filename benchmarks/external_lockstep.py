"""What asking a controller in a process costs beside the controller's own time: the same law as a C function.

    make -C examples/external/c
    python benchmarks/external_lockstep.py

Between two requests it computes for 8 us, about the rest of a tick. Medians: on a machine that does other
things too, means are those of its scheduler.
"""

import argparse
from pathlib import Path

import numpy as np

from surgsim.compiled import compiled
from surgsim.control.external.calls import monotonic
from surgsim.control.external.exchange import exchange
from surgsim.control.external.given_commands import giving
from surgsim.control.external.layout import JOINT_VELOCITY
from surgsim.control.external.outside import Outside
from surgsim.control.seen import new_seen
from surgsim.models.arm import ArmModel
from surgsim.scenario.load import load_scenario
from surgsim.tick.clock import thread_time

BUILT = Path(__file__).parents[1] / "examples" / "external" / "c" / "build"
REST_S = 8e-6


@compiled
def many(gains, seen, memory, out, wall, thread):
    failed = 0
    for i in range(wall.size):
        began, computed = monotonic(), thread_time()
        failed += exchange(gains, seen, memory, out)
        thread[i] = thread_time() - computed
        wall[i] = monotonic() - began
        until = monotonic() + REST_S
        while monotonic() < until:
            pass
    return failed


def measure(arm, command, requests):
    """Wall and thread time of each request (requests,) [us]."""
    seen = new_seen(arm, dt_s=1e-3, has_trocar=False)
    kin = arm.kinematics(0.5 * (arm.limits.q_min + arm.limits.q_max) + 0.3)
    seen.Jv_WT[:], seen.p_WT[:], seen.p_WTd[:] = kin.Jv_WT, kin.p_WT, kin.p_WT
    with giving({"measured": command}):
        asked = Outside("measured", arm, JOINT_VELOCITY, timeout_s=0.5, start_timeout_s=30.0)
    memory, out = np.zeros(asked.memory_size + 1), np.zeros(seen.q.size)
    wall, thread = np.zeros(requests), np.zeros(requests)
    failed = many(asked.gains, seen, memory, out, wall, thread)
    asked.close()
    assert failed == 0
    return 1e6 * wall, 1e6 * thread


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--requests", type=int, default=20_000)
    requests = options.parse_args().requests
    arm = ArmModel(load_scenario("circle_lwr4plus").scene)
    figures = {}
    for kind, command in (("function", f"{BUILT}/libexample.so:velocity"), ("process", f"{BUILT}/velocity")):
        wall, thread = measure(arm, command, requests)
        figures[kind] = np.median(wall), np.median(thread)
        quantiles = ", ".join(f"{np.quantile(wall, share):.1f}" for share in (0.5, 0.9, 0.99))
        print(f"{kind:9s} wall median, 90 %, 99 %: {quantiles} us; thread median {np.median(thread):.1f} us")
    wall, thread = np.subtract(figures["process"], figures["function"])
    print(f"lockstep  wall {wall:.1f} us, thread {thread:.1f} us")


if __name__ == "__main__":
    main()
