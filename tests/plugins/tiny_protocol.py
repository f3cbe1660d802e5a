"""A protocol of runs so short that the whole of it takes a second."""

from pathlib import Path
from typing import Any

from surgsim.compare.job import attempt
from surgsim.compare.workers import Done
from surgsim.protocol.definition import Protocol, load_protocol
from surgsim.protocol.entrants import entrant
from surgsim.protocol.score import Wish
from surgsim.protocol.seeds import Seeds

TINY = """\
name: tiny
description: a circle of a fifth of a second
draft: true
arms:
  panda:
    trocar: {position_m: [0.0, 0.65, 0.15], wall: {}}
    start: {posture_rad: [1.5708, 0.0, 0.0, -1.5708, 0.0, 1.8675, 0.0]}
    task: {start_m: [0.0005, 0.65, -0.03]}
  lwr4plus:
    trocar: {position_m: [0.0, 0.55, 0.20], wall: {}}
    start: {posture_rad: [1.5708, -0.5236, 0.0, 1.5708, 0.0, -1.0472, 0.0]}
    task: {start_m: [0.0005, 0.55, 0.02]}
thresholds:
  tip_error_max_mm: {most: 2.0, source: a test}
  trocar_force_max_n: null
generators:
  circle:
    description: a small circle
    base:
      task: {type: circle, radius_m: 0.0005, duration_s: 0.15, ramp_s: 0.05, hold_start_s: 0.0}
      disturbances: [{type: sensor_noise}]
    seeds: 2
    axes:
      payload:
        label: unknown payload [kg]
        levels: [0.1, 10.0]
        key: disturbances.1.mass_kg
        settings: ["disturbances=[{type: sensor_noise}, {type: payload}]"]
tracks:
  nominal:
    description: the nominal model
    generators: [circle]
    ports: [measured]
    instruments: [nominal]
    entries: [joint_impedance, pinv]
    baselines: [pinv]
  port_tracked:
    description: the port is tracked
    generators: [circle]
    ports: ["*"]
    instruments: [nominal]
    entries: [rcm_inverse_dynamics]
  velocity_level:
    description: joint velocities
    generators: [circle]
    ports: ["*"]
    instruments: [nominal]
    servo: {torque_law: {type: joint_impedance}, evaluate_at: reference}
    schemes:
      soft: ["controller.torque_law.stiffness_factor=0.5"]
      stiff: ["controller.torque_law.stiffness_factor=1.0"]
    entries: [pinv+soft]
metrics: [tip_error_max_mm, rcm_error_max_mm, torque_ratio_max]
figures:
  completed: {label: runs that came to their end, kind: completed, margin: 0.05, margin_source: a test}
  done: {label: runs that did their task, kind: done, margin: 0.05, margin_source: a test}
  levels_held: {label: levels that are held, kind: held, margin: 0.05, margin_source: a test}
  tip_p95:
    {label: "tip error [mm]", kind: quantile, metric: tip_error_max_mm, margin: 0.1, margin_source: a test}
"""


class Here:
    """Does jobs in this process, in order, and counts them; stops before the `last`, if one is given."""

    def __init__(self, last: int | None = None) -> None:
        self.count, self.last = 0, last

    def __call__(self, jobs: Any, _: int) -> Any:
        for index, job in enumerate(jobs):
            if self.count == self.last:
                raise KeyboardInterrupt
            self.count += 1
            yield Done(index=index, outcome=attempt(job)[1])


def write_protocol(folder: Path, text: str = TINY, name: str = "tiny") -> Protocol:
    """The protocol of that text, not frozen."""
    path = folder / f"{name}.yaml"
    path.write_text(text, encoding="utf-8")
    return load_protocol(str(path))


def wish(protocol: Protocol, name: str = "joint_impedance", track: str = "nominal", **changes: Any) -> Wish:
    """A controller on the Panda with development seeds."""
    given = {"arms": ("panda",), "seeds": Seeds(), "entrant": entrant(name), **changes}
    return Wish(protocol=protocol, track=track, **given)
