"""The 3-D scene of a recording, rebuilt from the scenario and the joint positions of the trace."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import rerun as rr

from surgsim.array import Array
from surgsim.models.build import Scene, SharedArm, SpecModifier, build, build_shared
from surgsim.recording import palette
from surgsim.recording.layout import SCENE, TIMELINE, timestamps
from surgsim.recording.replay import Replay
from surgsim.recording.shapes import Triangles, geom_triangles, joined
from surgsim.scenario.arms import ArmsScenario, Experiment, each_arm, experiment_of
from surgsim.scenario.schema import Scenario
from surgsim.spatial import nearest_on_line
from surgsim.trace.trace import Trace

RCM_ARROW_SCALE = 20.0
DESIRED_PATH, ACTUAL_PATH = "desired_path", "actual_path"
_DRAWN_GROUPS = 3  # MuJoCo shows geom groups 0 to 2 and keeps collision shapes in 3
_POINTS_PER_LINE = 2000
_DASH_SHARE = 0.06  # length of a dash over the extent of its line


def scenario_of(trace: Trace) -> Experiment:
    """The scenario that `trace` was made from."""
    return experiment_of(trace.meta.scenario)


def rebuild(scenario: Scenario) -> Scene:
    """The scene that was simulated, disturbances and props included."""
    return build(scenario.scene, scenario.build_parts())


def rebuild_all(
    scenario: Experiment, *, theatre: bool = False, cameras: Sequence[SpecModifier] = ()
) -> tuple[Scene, ...]:
    """The scenes of the arms that were simulated, in one model.

    Args:
        scenario: What was simulated.
        theatre: Whether the theatre is there whatever the scenario says.
        cameras: That are added, beside the first arm.
    """
    arms = [
        SharedArm(
            name=name,
            config=one.scene.model_copy(update={"theatre": one.theatre or theatre}),
            modifiers=[*one.build_parts(), *(cameras if first else ())],
        )
        for first, name, one in _in_order(scenario)
    ]
    return build_shared(arms) if len(arms) > 1 else (build(arms[0].config, arms[0].modifiers),)


def _in_order(scenario: Experiment) -> Iterator[tuple[bool, str, Scenario]]:
    """Whether an arm is the first one, its name, and its scenario."""
    names = scenario.names if isinstance(scenario, ArmsScenario) else ("",)
    for name, one in zip(names, each_arm(scenario), strict=True):
        yield name == names[0], name, one


def log_scene(stream: rr.RecordingStream, scenario: Experiment, trace: Trace) -> None:
    """Draw the theatre, the moving bodies, and of each arm both paths, the tip and the RCM error."""
    scenes = rebuild_all(scenario)
    bodies = log_shapes(stream, scenes[0])
    rows = sampled_rows(len(trace), scenario.recording.scene_rate_hz * trace.meta.control_period_s)
    log_poses(stream, scenes, bodies, trace, rows)
    for scene, one in zip(scenes, trace.each(), strict=True):
        log_paths(stream, one.block("tip_ref"), one.block("tip"), scene.prefix)
        log_points(stream, one, rows, scene)


def log_shapes(stream: rr.RecordingStream, scene: Scene) -> dict[int, str]:
    """Draw what the bodies look like; the entities of those that are drawn, by the body."""
    stream.log(SCENE, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    entities = {}
    for body, surfaces in _surfaces(scene.model).items():
        entities[body] = path = f"{SCENE}/{scene.model.body(body).name}"
        for name, (surface, rgba) in surfaces.items():
            stream.log(f"{path}/{name}", _mesh(surface, rgba), static=True)
    return entities


def log_poses(
    stream: rr.RecordingStream,
    scenes: Sequence[Scene],
    bodies: Mapping[int, str],
    trace: Trace,
    rows: np.ndarray[tuple[int], np.dtype[np.intp]],
    *,
    goes_on: bool = False,
) -> None:
    """Put the drawn bodies where they were at `rows`.

    Args:
        stream: Where to.
        scenes: The scenes of the arms.
        bodies: Of `log_shapes`.
        trace: The run, or a piece of it.
        rows: Of the trace.
        goes_on: Whether further pieces follow: a body that can move is then never said to stand for good.
    """
    poses, model = body_poses(scenes, trace, rows), scenes[0].model
    for body, path in bodies.items():
        fixed = model.body_weldid[body] == 0 and model.body_mocapid[body] < 0
        _log_pose(stream, path, trace["t_s"][rows], poses, body, may_stand=fixed or not goes_on)


def sampled_rows(count: int, samples_per_tick: float) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Rows at the scene's rate, always with the first and the last one."""
    step = max(1, round(1.0 / samples_per_tick))
    rows: np.ndarray[tuple[int], np.dtype[np.intp]] = np.unique(
        np.append(np.arange(0, count, step), count - 1)
    ).astype(np.intp)
    return rows


@dataclass(frozen=True, eq=False)
class Poses:
    """World poses of all bodies at the sampled rows.

    Attributes:
        position: Origins (rows, bodies, 3) [m].
        quaternion: Orientations (rows, bodies, 4), wxyz.
    """

    position: Array
    quaternion: Array


def body_poses(
    scenes: Scene | Sequence[Scene], trace: Trace, rows: np.ndarray[tuple[int], np.dtype[np.intp]]
) -> Poses:
    """Forward kinematics at `rows` of the trace; a port follows its trocar."""
    replay = Replay(scenes, trace)
    position = np.empty((len(rows), len(replay.data.xpos), 3))
    quaternion = np.empty((len(rows), len(replay.data.xquat), 4))
    for i, row in enumerate(rows):
        replay.place(int(row))
        position[i], quaternion[i] = replay.data.xpos, replay.data.xquat
    return Poses(position, quaternion)


def _surfaces(model: mujoco.MjModel) -> dict[int, dict[str, tuple[Triangles, Array]]]:
    """Per body the drawn geoms, those of one material joined, by the material's name."""
    found: dict[int, dict[str, tuple[list[Triangles], Array]]] = {}
    for geom in range(model.ngeom):
        material = int(model.geom_matid[geom])
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        triangles = geom_triangles(model, geom)
        if model.geom_group[geom] >= _DRAWN_GROUPS or rgba[3] == 0.0 or triangles is None:
            continue
        name = model.mat(material).name.split("/")[-1] if material >= 0 else f"geom{geom}"
        parts = found.setdefault(int(model.geom_bodyid[geom]), {})
        parts.setdefault(name, ([], _shown(model, material, rgba)))[0].append(triangles)
    return {
        body: {name: (joined(parts), rgba) for name, (parts, rgba) in by_name.items()}
        for body, by_name in found.items()
    }


def _shown(model: mujoco.MjModel, material: int, rgba: Array) -> Array:
    """Colour (4,) to draw with: a textured material's mean colour, else its own."""
    texture = int(model.mat_texid[material][mujoco.mjtTextureRole.mjTEXROLE_RGB]) if material >= 0 else -1
    if texture < 0:
        return np.array(rgba, dtype=np.float64)
    channels = int(model.tex_nchannel[texture])
    size = int(model.tex_height[texture]) * int(model.tex_width[texture]) * channels
    texels = model.tex_data[model.tex_adr[texture] :][:size].reshape(-1, channels)
    return np.array([*(texels[:, :3].mean(axis=0) / 255.0 * rgba[:3]), rgba[3]])


def _mesh(surface: Triangles, rgba: Array) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=surface.points.astype(np.float32),
        vertex_normals=surface.normals.astype(np.float32),
        triangle_indices=surface.faces.astype(np.uint32),
        face_rendering=rr.components.MeshFaceRendering.Front,  # as MuJoCo draws them
        albedo_factor=np.rint(255 * rgba).astype(np.uint8),
    )


def _log_pose(
    stream: rr.RecordingStream, path: str, t_s: Array, poses: Poses, body: int, *, may_stand: bool
) -> None:
    """A body's pose: once if it never moves, else at every sample. rerun's quaternions are xyzw."""
    position, quaternion = poses.position[:, body], poses.quaternion[:, body][:, [1, 2, 3, 0]]
    if may_stand and np.all(position == position[0]) and np.all(quaternion == quaternion[0]):
        pose = rr.Transform3D(translation=position[0], quaternion=rr.Quaternion(xyzw=quaternion[0]))
        stream.log(path, pose, static=True)
        return
    columns = rr.Transform3D.columns(
        translation=position.astype(np.float32), quaternion=quaternion.astype(np.float32)
    )
    stream.send_columns(path, [rr.TimeColumn(TIMELINE, duration=timestamps(t_s))], columns)


def log_paths(stream: rr.RecordingStream, desired: Array, actual: Array, of: str = "") -> None:
    """Both paths (rows, 3); the desired one in dashes, so that the actual one on it is seen between them.

    `of` is what stands before the names of one of several arms.
    """
    rows = np.unique(np.linspace(0, len(actual) - 1, _POINTS_PER_LINE).astype(np.intp))
    for name, points, color, width in (
        (DESIRED_PATH, desired, palette.SKY, 1.8),
        (ACTUAL_PATH, actual, palette.BLACK, 0.8),
    ):
        line = points[rows]
        line = line[np.isfinite(line).all(axis=1)]
        strips = dashes(line) if name == DESIRED_PATH else [line]
        shown = rr.LineStrips3D(
            [strip.astype(np.float32) for strip in strips], radii=rr.Radius.ui_points(width), colors=[color]
        )
        stream.log(f"{SCENE}/{of}{name}", shown, static=True)


def dashes(line: Array) -> list[Array]:
    """Every other piece of `line` (n, 3) [m], each a fixed share of the line's extent long."""
    extent = float(np.linalg.norm(np.ptp(line, axis=0))) if len(line) else 0.0
    if extent == 0.0:
        return [line]
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()])
    piece = np.floor(along / (_DASH_SHARE * extent)).astype(np.intp)
    starts = np.flatnonzero(np.diff(piece, prepend=-1))
    ends = np.append(starts[1:], len(line) - 1) + 1  # up to the next piece's first point
    return [line[a:b] for a, b in zip(starts, ends, strict=True) if piece[a] % 2 == 0]


def log_points(
    stream: rr.RecordingStream, trace: Trace, rows: np.ndarray[tuple[int], np.dtype[np.intp]], scene: Scene
) -> None:
    """The tip, and the RCM error as an arrow from the trocar to the shaft, of the arm in `scene`."""
    times = [rr.TimeColumn(TIMELINE, duration=timestamps(trace["t_s"][rows]))]
    tip, trocar = trace.block("tip")[rows], trace.block("trocar")[rows]
    point = f"{SCENE}/{scene.prefix}tip"
    arrow = f"{SCENE}/{scene.prefix}rcm_error_x{RCM_ARROW_SCALE:g}"
    stream.log(
        point,
        rr.Points3D.from_fields(colors=[palette.VERMILION], radii=rr.Radius.ui_points(2.5)),
        static=True,
    )
    stream.send_columns(point, times, rr.Points3D.columns(positions=tip.astype(np.float32)))
    if not np.isfinite(trocar).all():
        return
    style = rr.Arrows3D.from_fields(
        colors=[palette.YELLOW],
        radii=rr.Radius.ui_points(2.5),
        labels=[f"RCM error x{RCM_ARROW_SCALE:g}"],
        show_labels=False,  # it would cover the port
    )
    stream.log(arrow, style, static=True)
    vectors = RCM_ARROW_SCALE * rcm_errors(tip, trace.block("wrist")[rows], trocar, angled=scene.is_angled)
    columns = rr.Arrows3D.columns(origins=trocar.astype(np.float32), vectors=vectors.astype(np.float32))
    stream.send_columns(arrow, times, columns)


def rcm_errors(tip: Array, wrist: Array, trocar: Array, *, angled: bool) -> Array:
    """Vectors (n, 3) [m] from the trocar to the nearest point of the shaft's axis.

    Args:
        tip: One point of the axis (n, 3) [m], unless it is angled.
        wrist: Another (n, 3) [m]; that nearest to the trocar where the tip is angled.
        trocar: Remote centre of motion (n, 3) [m].
        angled: Whether the tip is off the axis.
    """
    return (wrist if angled else nearest_on_line(trocar, wrist, tip)) - trocar
