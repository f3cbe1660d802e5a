"""Train a policy on a scenario, and run it as a controller beside the shipped ones.

    python examples/train_policy.py                     about two minutes
    python examples/train_policy.py --generations 1     to see that it works

The policy is linear: the velocity of the tip is the command's, a lead along its acceleration, and a pull
back along the tip error, with a gain for each axis. Its four numbers are found by CMA-ES (Hansen 2016), which
needs no gradients. An episode is a run of the scenario with a payload drawn anew; rewards are those of
`surgsim.env`.
"""

import argparse
import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from cmaes import CMA
from numpy.typing import NDArray

import surgsim
from surgsim.env import load, register_policy

Array = NDArray[np.float64]
SETTINGS = {
    "task": {"duration_s": 2.0, "ramp_s": 0.5},
    "disturbances": [{"type": "payload", "mass_kg": 0.2, "spread": 0.5}],
}
SCALE = np.array([5.0, 5.0, 5.0, 0.02])
"""What 1 in the search stands for: gains [1/s] and the lead [s]."""


def policy_of(numbers: Array) -> Callable[[Mapping[str, Array]], Array]:
    """The policy of four numbers: u = v_d + lead a_d - gains * (p - p_d)."""
    gains, lead = numbers[:3], numbers[3]

    def policy(observation: Mapping[str, Array]) -> Array:
        ahead = observation["command_velocity"] + lead * observation["command_acceleration"]
        return ahead - gains * observation["tip_error"]

    return policy


def reward_of(environment, numbers: Array) -> float:
    """Mean reward of one episode; a run that ends early loses what was still to come."""
    policy, step, rewards = policy_of(numbers), environment.reset(), 0.0
    steps = round(SETTINGS["task"]["duration_s"] / environment.control_timestep())
    while not step.last():
        step = environment.step(policy(step.observation))
        rewards += step.reward or 0.0
    return rewards / steps


def main() -> None:
    """Train, keep the numbers, compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenario", default="circle_lwr4plus")
    parser.add_argument("--generations", type=int, default=12)
    parser.add_argument("--out", type=Path, default=Path("policy.json"), help="where the numbers are kept")
    given = parser.parse_args()

    scenario = surgsim.load(given.scenario, **SETTINGS)
    environment = load(scenario, action="tip_velocity", resolver="pinv", seed=1)
    search = CMA(mean=np.zeros(4), sigma=1.0, seed=1, population_size=8)
    for generation in range(given.generations):
        tried = [search.ask() for _ in range(search.population_size)]
        rewards = [reward_of(environment, SCALE * numbers) for numbers in tried]
        search.tell([(numbers, -reward) for numbers, reward in zip(tried, rewards, strict=True)])
        print(
            f"generation {generation + 1}: reward {np.mean(rewards):.4f}, best {max(rewards):.4f}", flush=True
        )
    numbers = SCALE * search.mean
    given.out.write_text(json.dumps(numbers.tolist()), encoding="utf-8")
    print(f"gains {numbers[:3].round(2)} per s, lead {numbers[3]:.3g} s; wrote {given.out}")

    register_policy("trained", policy_of(numbers))
    trained = {
        "name": "trained",
        "resolver": {"type": "policy", "name": "trained", "decimation": 20, "resolver": {"type": "pinv"}},
        "torque_law": {"type": "hierarchical_impedance"},
    }
    for controller in ("pinv", trained):  # seeds that the training did not use
        runs = [
            surgsim.run(given.scenario, controller=controller, seed=seed, **SETTINGS)
            for seed in (101, 102, 103)
        ]
        tip, rcm = (np.mean([run.metrics[f"{what}_error_rms_mm"] for run in runs]) for what in ("tip", "rcm"))
        print(f"{runs[0].controller}: tip error {tip:.3g} mm, RCM error {rcm:.3g} mm, RMS over three seeds")


if __name__ == "__main__":
    main()
