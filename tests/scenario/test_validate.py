import enum
from collections.abc import Callable
from typing import Annotated, Any, Literal, Union

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import Field, model_validator

from surgsim.catalog import PartConfig
from surgsim.errors import ScenarioError
from surgsim.scenario.validate import validate
from surgsim.scenario.yaml_text import YamlDocument, dump_yaml, parse_yaml, read_yaml, set_value

Vec3 = tuple[float, float, float]


class Axis(enum.Enum):
    X = "x"
    Y = "y"


class Circle(PartConfig):
    type: Literal["circle"] = "circle"
    radius_m: float = Field(gt=0, le=0.1)
    centre_m: Vec3 = (0.0, 0.0, 0.0)


class Line(PartConfig):
    type: Literal["line"] = "line"
    points_m: list[Vec3] = Field(min_length=2)


class Mass(PartConfig):
    type: Literal["mass"] = "mass"
    mass_kg: Annotated[float, Field(ge=0)]


class Wave(PartConfig):
    type: Literal["wave"] = "wave"
    axis: Axis = Axis.X
    gain: float | Vec3 = 1.0


class Qp(PartConfig):
    type: Literal["qp"] = "qp"
    weight: float | None = None


class Vprnn(PartConfig):
    type: Literal["vprnn"] = "vprnn"


class Hand(PartConfig):
    type: Literal["hand"] = "hand"


AnyTask: Any = Annotated[Union[Circle, Line], Field(discriminator="type", title="task")]  # noqa: UP007
AnyResolver: Any = Annotated[Union[Qp, Vprnn], Field(discriminator="type", title="resolver")]  # noqa: UP007
AnyDisturbance: Any = Annotated[Union[Mass, Wave], Field(discriminator="type")]  # noqa: UP007
OnlyHand: Any = Annotated[Hand, Field(title="gripper")]


class Controller(PartConfig):
    resolver: AnyResolver
    period_s: float = Field(0.001, gt=0)
    timestep_s: float = 0.001

    @model_validator(mode="after")
    def _ratio(self) -> "Controller":
        if self.period_s < self.timestep_s:
            raise ValueError(f"period_s {self.period_s:g}\nis shorter than timestep_s {self.timestep_s:g}")
        return self


class World(PartConfig):
    version: Literal[1] = 1
    name: str = Field(min_length=1, pattern="^[a-z]")
    mode: Literal["fast", "exact"] = "fast"
    seed: int = Field(0, ge=0)
    theatre: bool = True
    task: AnyTask
    controller: Controller
    disturbances: tuple[AnyDisturbance, ...] = ()
    gripper: OnlyHand | None = None
    limits: dict[str, float] = Field(default_factory=dict)


TEXT = """\
name: reach
mode: exact
seed: 3
theatre: false
task:
  type: circle
  radius_m: 0.02
  centre_m: [0.5, 0, 1]
controller:
  resolver:
    type: qp
    weight: 1
disturbances:
  - type: mass
    mass_kg: 0.2
  - type: wave
    axis: y
    gain: [1, 2, 3]
gripper:
  type: hand
limits:
  force_n: 5
"""


def load(text: str) -> World:
    return validate(World, parse_yaml(text, "s.yaml"))


def failure(document: YamlDocument) -> str:
    with pytest.raises(ScenarioError) as caught:
        validate(World, document)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def test_valid_document():
    world = load(TEXT)
    assert world.task == Circle(radius_m=0.02, centre_m=(0.5, 0.0, 1.0))
    assert isinstance(world.task.centre_m[1], float)
    assert world.disturbances == (Mass(mass_kg=0.2), Wave(axis=Axis.Y, gain=(1.0, 2.0, 3.0)))
    assert world.gripper == Hand()
    assert load(dump_yaml(world.model_dump(mode="json"))) == world


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (
            "type: qp",
            "type: vprn",
            "s.yaml:11: controller.resolver.type: 'vprn' is not a resolver. Known: qp, vprnn."
            " Did you mean 'vprnn'?",
        ),
        (
            "type: wave",
            "type: 5",
            "s.yaml:16: disturbances.1.type: 5 (a number) is not allowed. Allowed: 'mass', 'wave'.",
        ),
        (
            "type: wave",
            "type: wav",
            "s.yaml:16: disturbances.1.type: 'wav' is not a known type. Known: mass, wave."
            " Did you mean 'wave'?",
        ),
        ("type: hand", "type: claw", "s.yaml:20: gripper.type: 'claw' is not a gripper. Known: hand."),
        (
            "type: circle",
            "typ: circle",
            "s.yaml:5: task.type: missing. Expected one of circle, line. Is 'typ' meant to be it?",
        ),
        (
            "type: circle",
            "type:",
            "s.yaml:6: task.type: null (no value) is not allowed. Allowed: 'circle', 'line'.",
        ),
        (
            "radius_m: 0.02",
            "radius: 0.02",
            "s.yaml:7: task.radius: unknown key (value 0.02). Allowed: type, radius_m, centre_m."
            " Did you mean 'radius_m'?",
        ),
        (
            "  radius_m: 0.02\n",
            "",
            "s.yaml:5: task.radius_m: missing. Expected a number greater than 0 and at most 0.1.",
        ),
        ("radius_m: 0.02", "radius_m: two", "s.yaml:7: task.radius_m: 'two' (a string) is not a number"),
        ("radius_m: 0.02", "radius_m: '1'", "s.yaml:7: task.radius_m: '1' (a string) is not a number"),
        ("radius_m: 0.02", "radius_m: true", "s.yaml:7: task.radius_m: true (a truth value) is not a number"),
        ("radius_m: 0.02", "radius_m:", "s.yaml:7: task.radius_m: null (no value) is not a number"),
        ("radius_m: 0.02", "radius_m: -0.1", "s.yaml:7: task.radius_m: -0.1 is not allowed: must be greater"),
        ("radius_m: 0.02", "radius_m: 1", "is not allowed: must be less than or equal to 0.1"),
        (
            "weight: 1",
            "weight: a",
            "s.yaml:12: controller.resolver.weight: 'a' (a string) is not a number or",
        ),
        (
            "centre_m: [0.5, 0, 1]",
            "centre_m: [0.5, 0]",
            "s.yaml:8: task.centre_m: [0.5, 0] has 2 items. Expected a list of 3 numbers.",
        ),
        ("[0.5, 0, 1]", "[]", "s.yaml:8: task.centre_m: [] has 0 items. Expected a list of 3 numbers."),
        ("[0.5, 0, 1]", "[1, 2, 3, 4]", "task.centre_m: [1, 2, 3, 4] has 4 items. Expected a list of 3"),
        ("[0.5, 0, 1]", "[1, x, 3]", "s.yaml:8: task.centre_m.1: 'x' (a string) is not a number"),
        ("[0.5, 0, 1]", "0", "s.yaml:8: task.centre_m: 0 (a number) is not a list of 3 numbers"),
        ("mode: exact", "mode: exat", "s.yaml:2: mode: 'exat' is not allowed. Allowed: fast, exact. Did you"),
        ("axis: y", "axis: z", "s.yaml:17: disturbances.1.axis: 'z' is not allowed. Allowed: x, y."),
        ("seed: 3", "seed: 1.5", "s.yaml:3: seed: 1.5 (a number) is not an integer"),
        ("theatre: false", "theatre: no", "s.yaml:4: theatre: 'no' (a string) is not true or false"),
        ("theatre: false", "theatre: 1", "s.yaml:4: theatre: 1 (a number) is not true or false"),
        ("name: reach", "name: 7", "s.yaml:1: name: 7 (a number) is not a string"),
        ("name: reach", "name: Reach", "s.yaml:1: name: 'Reach' is not allowed: must match pattern '^[a-z]'"),
        ("name: reach", "name: ''", "s.yaml:1: name: '' is not allowed: must have at least 1 character"),
        (
            "name: reach",
            "version: 2\nname: reach",
            "s.yaml:1: version: 2 (a number) is not allowed. Allowed: 1.",
        ),
        (
            "gain: [1, 2, 3]",
            "gain: [1, 2]",
            "s.yaml:18: disturbances.1.gain: [1, 2] (a list) is not a number or a list of 3 numbers",
        ),
        ("force_n: 5", "force_n: x", "s.yaml:22: limits.force_n: 'x' (a string) is not a number"),
        (
            "  resolver:\n    type: qp\n    weight: 1\n",
            "  resolver: qp\n",
            "s.yaml:10: controller.resolver: 'qp' (a string) is not a mapping with the key type: qp, vprnn."
            " Did you mean {type: qp}?",
        ),
        (
            "  resolver:\n    type: qp\n    weight: 1\n",
            "  period_s: 1\n",
            "s.yaml:9: controller.resolver: missing. Expected a mapping with the key type: qp, vprnn.",
        ),
        (
            "controller:\n",
            "controller:\n  period_s: 1e-4\n",
            "s.yaml:9: controller: period_s 0.0001 is shorter than timestep_s 0.001",
        ),
        (
            "  type: circle\n  radius_m: 0.02\n  centre_m: [0.5, 0, 1]\n",
            "  type: line\n  points_m: [[0, 0, 0]]\n",
            "s.yaml:7: task.points_m: [[0, 0, 0]] has 1 item. Expected at least 2 items.",
        ),
        (
            "name: reach\n",
            "",
            "s.yaml:1: name: missing. Expected a string.",
        ),
        (
            "radius_m: 0.02",
            f"radius_m: {'x' * 900}",
            "s.yaml:7: task.radius_m: '" + "x" * 56 + "... (a string) is not a number",
        ),
    ],
)
def test_messages(old, new, reason):
    assert old in TEXT
    found = failure(parse_yaml(TEXT.replace(old, new), "s.yaml"))
    assert found.startswith(reason) if reason.startswith("s.yaml") else reason in found
    assert found == reason or not reason.endswith((".", "?", "number"))
    assert "more problem" not in found


def test_first_problem_in_document_order_and_the_count():
    text = TEXT.replace("type: qp", "type: q").replace("seed: 3", "seed: x").replace("axis: y", "axes: y")
    assert failure(parse_yaml(text, "s.yaml")) == (
        "s.yaml:3: seed: 'x' (a string) is not an integer (and 2 more problems)"
    )
    text = "zzz: 1\n" + TEXT.replace("seed: 3", "seed: x")
    assert failure(parse_yaml(text, "s.yaml")) == (
        "s.yaml:1: zzz: unknown key (value 1). Allowed: version, name, mode, seed, theatre, task, controller,"
        " disturbances, gripper, limits. (and 1 more problem)"
    )


def test_key_named_as_the_tag():
    text = TEXT.replace("radius_m: 0.02", "radius_m: 0.02\n  circle: 3")
    assert failure(parse_yaml(text, "s.yaml")).startswith("s.yaml:8: task.circle: unknown key (value 3)")
    text = TEXT.replace("  type: hand", "  type: hand\n  hand: 3")
    assert failure(parse_yaml(text, "s.yaml")).startswith("s.yaml:21: gripper.hand: unknown key (value 3)")


def test_overrides_are_checked_the_same_way():
    document = parse_yaml(TEXT, "s.yaml")
    assert validate(World, set_value(document, "task.radius_m=0.03")).task.radius_m == 0.03
    assert failure(set_value(document, "task.radius=0.03")) == (
        "--set task.radius=0.03: task.radius: unknown key (value 0.03). "
        "Allowed: type, radius_m, centre_m. Did you mean 'radius_m'?"
    )
    assert failure(set_value(document, "disturbances.0.mass_kg=-1")) == (
        "--set disturbances.0.mass_kg=-1: disturbances.0.mass_kg: -1 is not allowed:"
        " must be greater than or equal to 0"
    )
    assert failure(set_value(document, "task={type: circle}")).startswith(
        "--set task={type: circle}: task.radius_m: missing."
    )
    assert failure(set_value(document, "controler.period_s=1")).startswith(
        "--set controler.period_s=1: controler: unknown key (value {period_s: 1}). Allowed: "
    )


@pytest.mark.parametrize("value", ["9" * 400, "1e999", "-1e999", "[" * 15 + "]" * 15, "'" + "\\" * 999 + "'"])
def test_weird_values(value):
    with pytest.raises(ScenarioError):
        load(TEXT.replace("radius_m: 0.02", f"radius_m: {value}"))


def test_many_problems_are_quick():
    text = TEXT + "".join(f"radius_{i}: 1\n" for i in range(15_000))
    assert failure(parse_yaml(text, "s.yaml")).endswith("(and 14999 more problems)")


def complaint(call: Callable[[], object]) -> str:
    """Message of the error, empty if there is none; any other exception is a failure."""
    try:
        call()
    except ScenarioError as error:
        return str(error)
    return ""


LINES = TEXT.splitlines(keepends=True)
JUNK = st.sampled_from(
    [
        "null",
        "[]",
        "{}",
        "-1",
        "1e999",
        "two",
        "true",
        "'",
        '"\\',
        "&a",
        "*a",
        "!!x y",
        "[[",
        "{a",
        ": :",
        "? a",
    ]
) | st.text(max_size=8)


@st.composite
def mutants(draw: st.DrawFn) -> str:
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(lines) - 1))
        head, colon, rest = lines[at].partition(":")
        lines[at : at + 1] = draw(
            st.sampled_from(
                [
                    [],
                    [lines[at]] * 2,
                    [f"{head[:-1]}{colon}{rest}"],
                    [f"{head}x{colon}{rest}"],
                    [f"{head}: {draw(JUNK)}\n"],
                    [f"  {lines[at]}"],
                    [lines[at].lstrip()],
                    [f"{head}: " + "[" * 40 + "\n"],
                    [lines[draw(st.integers(0, len(lines) - 1))]],
                ]
            )
        ) or ["\n"]
    text = "".join(lines)
    cut = draw(st.integers(0, len(text)))
    return text[:cut] if draw(st.booleans()) else text[:cut] + draw(JUNK) + text[cut:]


@settings(max_examples=300, deadline=None)
@given(mutants())
@example("a: [1")
def test_mutants_give_one_line_or_load(text):
    found = complaint(lambda: load(text))
    assert len(found.splitlines()) <= 1
    assert len(found) < 1000
    assert not found or found.startswith("s.yaml:")


@settings(max_examples=100, deadline=None)
@given(st.integers(0, len(TEXT)), st.binary(min_size=1, max_size=8))
def test_random_bytes_in_a_file(tmp_path_factory, at, junk):
    path = tmp_path_factory.getbasetemp() / "bytes.yaml"
    path.write_bytes(TEXT[:at].encode() + junk + TEXT[at:].encode())
    assert len(complaint(lambda: validate(World, read_yaml(path))).splitlines()) <= 1


ANY = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**62), 2**62)
    | st.floats(-1e9, 1e9)
    | st.text("ab\n'", max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["type", "x", "name", "weight"]), inner, max_size=4)
    ),
    max_leaves=6,
)
PATHS = list(parse_yaml(TEXT, "s.yaml").lines)[1:]


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(PATHS), ANY)
def test_any_value_anywhere(path, value):
    tree = parse_yaml(TEXT, "s.yaml").tree
    node: Any = tree
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    assert len(complaint(lambda: load(dump_yaml(tree))).splitlines()) <= 1


@settings(max_examples=300, deadline=None)
@given(
    st.one_of(st.text(max_size=40), st.sampled_from(PATHS).map(lambda p: ".".join(map(str, p)) + "=")), JUNK
)
def test_any_override(head, tail):
    found = complaint(lambda: validate(World, set_value(parse_yaml(TEXT, "s.yaml"), head + tail)))
    assert len(found.splitlines()) <= 1
