import math
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surgsim.errors import ScenarioError
from surgsim.scenario.yaml_text import dump_yaml, parse_yaml, read_yaml, set_value

TEXT = """\
name: reach  # comment
task:
  type: circle
  radius_m: 2e-2
  centre_m: [0.5, 0, .1]
disturbances:
  - type: mass
    mass_kg: 0.2
  - type: none
trocar: null
"""


def message(text):
    with pytest.raises(ScenarioError) as caught:
        parse_yaml(text, "s.yaml")
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def set_message(assignment):
    with pytest.raises(ScenarioError) as caught:
        set_value(parse_yaml(TEXT, "s.yaml"), assignment)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def test_tree_and_lines():
    document = parse_yaml(TEXT, "s.yaml")
    assert document.tree == {
        "name": "reach",
        "task": {"type": "circle", "radius_m": 0.02, "centre_m": [0.5, 0, 0.1]},
        "disturbances": [{"type": "mass", "mass_kg": 0.2}, {"type": "none"}],
        "trocar": None,
    }
    assert document.lines[()] == 1
    assert document.lines["task",] == 2
    assert document.lines["task", "radius_m"] == 4
    assert document.lines["task", "centre_m", 2] == 5
    assert document.lines["disturbances", 1] == 9
    assert document.where(("task", "radius")) == "s.yaml:2: task.radius"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1E3", 1000.0),
        ("-.5", -0.5),
        ("5.", 5.0),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("+3", 3),
        ("yes", "yes"),
        ("off", "off"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2024-01-02", "2024-01-02"),
        ("'1'", "1"),
        ('"true"', "true"),
        ("True", True),
        ("~", None),
        ("", None),
        ("|\n  two\n  lines", "two\nlines\n"),
        ("é😀", "é😀"),
    ],
)
def test_scalars(text, value):
    found = parse_yaml(f"a: {text}\n", "s.yaml").tree["a"]
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "s.yaml:1: the file is empty"),
        (" \n\n", "s.yaml:1: the file is empty"),
        ("# only\n", "s.yaml:1: the file is empty"),
        ("- 1\n", "s.yaml:1: the top level is [1] (a list), not a mapping of keys to values"),
        ("reach\n", "s.yaml:1: the top level is 'reach' (a string), not a mapping of keys to values"),
        ("---\n", "s.yaml:1: the top level is null (no value), not a mapping of keys to values"),
        ("a: 1\nb:\n  c: 1\n  d: 2\n  c: 3\n", "s.yaml:5: b.c: duplicate key, first given on line 3"),
        ("a: &x 1\n", "s.yaml:1: a: anchors (&) and aliases (*) are not allowed; quote such a text"),
        ("a: *x\n", "s.yaml:1: a: anchors (&) and aliases (*) are not allowed; quote such a text"),
        ("a:\n  <<: {b: 1}\n", "s.yaml:2: a: merge keys (<<) are not allowed"),
        ("a: !!python/name:os.system\n", "s.yaml:1: a: tags (!) are not allowed: "),
        ("a: !!str 1\n", "s.yaml:1: a: tags (!) are not allowed: 'tag:yaml.org,2002:str'; quote such a text"),
        ("a: !!binary aGk=\n", "s.yaml:1: a: tags (!) are not allowed: "),
        ("a: ! 1\n", "s.yaml:1: a: tags (!) are not allowed: '!'"),
        ("%YAML 1.1\n---\na: 1\n", "s.yaml:2: directives (%) are not allowed"),
        ("a: 1\n---\nb: 2\n", "s.yaml:2: a second document starts here: one is allowed"),
        ("a: 1\n1: 2\n", "s.yaml:2: a key must be a string of printable characters: 1"),
        ("b:\n  true: 2\n", "s.yaml:2: b: a key must be a string of printable characters: true"),
        ("? [a, b]\n: 1\n", "s.yaml:1: a key must be a plain string"),
        ('"a\\nb": 1\n', "s.yaml:1: a key must be a string of printable characters: 'a\\nb'"),
        ("b: 1\na: .nan\n", "s.yaml:2: a: .nan is not a finite number"),
        ("a: [1, -.inf]\n", "s.yaml:1: a.1: -.inf is not a finite number"),
        ("a: 1e400\n", "s.yaml:1: a: 1e400 is out of range of a double-precision number"),
        ("a: 1e-400\n", "s.yaml:1: a: 1e-400 is out of range of a double-precision number"),
        ("a: 9223372036854775808\n", "s.yaml:1: a: 9223372036854775808 is out of range: an integer has"),
        ("a: " + "9" * 9000, "s.yaml:1: a: 99999"),
        ("a: 1\nb: \x00\n", "s.yaml:2: has a control or invalid character: '\\x00'"),
        ('a: "\\0"\n', "s.yaml:1: a: has a control or invalid character: '\\x00'"),
        ('a: "\\ud800"\n', "s.yaml:1: a: has a control or invalid character: '\\ud800'"),
        ('a: "\\U00110000"\n', "s.yaml:1: is not valid YAML: "),
        ("a: \ud800\n", "s.yaml:1: has a control or invalid character: '\\ud800'"),
        ("a: 1\nb: [1, 2\nc: 3\n", "s.yaml:3: is not valid YAML: "),
        ("a: 1\n b: 2\n", "s.yaml:2: is not valid YAML: mapping values are not allowed"),
        ("a:\n\t- 1\n", "s.yaml:2: is not valid YAML: "),
        ("a: 'open\n", "is not valid YAML: "),
    ],
)
def test_refused(text, reason):
    assert reason in message(text)


@pytest.mark.parametrize(
    "text",
    ["a: " + "[" * 100_000, "[" * 100_000, "- " * 100_000, "{a: " * 60_000, "? - " * 60_000],
)
def test_deep_nesting_is_refused_before_building(text):
    assert message(text) in (
        "s.yaml:1: nested deeper than 16 levels",
        "s.yaml:1: a key must be a plain string",
    )


def test_nesting_up_to_the_bound_is_allowed():
    inner = "[" * 15 + "]" * 15
    assert parse_yaml(f"a: {inner}\n", "s.yaml").tree["a"]
    assert "nested deeper" in message(f"a: [{inner}]\n")


def test_size_is_bounded():
    assert message("a: " + "x" * 300_000) == "s.yaml:1: is larger than 256 KiB"
    assert "larger than" in message("a: " + "é" * 150_000)


def test_read_yaml(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.encode())
    assert read_yaml(path).tree == parse_yaml(TEXT, "x").tree
    assert read_yaml(path).source == str(path)


def test_read_yaml_failures(tmp_path):
    def reason(path):
        with pytest.raises(ScenarioError) as caught:
            read_yaml(path)
        assert len(str(caught.value).splitlines()) == 1
        return str(caught.value).removeprefix(str(tmp_path) + "/")

    assert reason(tmp_path / "no.yaml") == "no.yaml: cannot be read: No such file or directory"
    assert reason(tmp_path / "a\nb\0.yaml").startswith("a\\nb\\x00.yaml: cannot be read: ")
    (tmp_path / "folder").mkdir()
    assert reason(tmp_path / "folder") == "folder: is a folder or a device, not a scenario file"
    os.mkfifo(tmp_path / "pipe")
    assert reason(tmp_path / "pipe") == "pipe: is a folder or a device, not a scenario file"
    (tmp_path / "latin").write_bytes(b"a: 1\nb: \xe9\n")
    assert reason(tmp_path / "latin") == "latin:2: is not UTF-8 text: byte 0xe9 at offset 8"
    (tmp_path / "big").write_bytes(b"a" * 300_000)
    assert reason(tmp_path / "big") == "big: is larger than 256 KiB"


def test_set_replaces_and_creates():
    old = parse_yaml(TEXT, "s.yaml")
    new = old
    for assignment in (
        "task.radius_m=0.03",
        "disturbances.0.mass_kg=1",
        "task.centre_m=[1, 2, 3]",
        "recording.rate_hz=50",
        "trocar={radius_m: 1e-3}",
        "name=a=b",
    ):
        new = set_value(new, assignment)
    assert new.tree["task"] == {"type": "circle", "radius_m": 0.03, "centre_m": [1, 2, 3]}
    assert new.tree["disturbances"][0]["mass_kg"] == 1
    assert new.tree["recording"] == {"rate_hz": 50}
    assert new.tree["trocar"] == {"radius_m": 0.001}
    assert new.tree["name"] == "a=b"
    assert old == parse_yaml(TEXT, "s.yaml")
    assert new.lines["task", "radius_m"] == "--set task.radius_m=0.03"
    assert new.lines["task",] == 2
    assert new.where(("task", "radius_m")) == "--set task.radius_m=0.03: task.radius_m"
    assert new.where(("recording", "x")) == "--set recording.rate_hz=50: recording.x"
    assert ("task", "centre_m", 2) in new.lines


@pytest.mark.parametrize(
    ("assignment", "reason"),
    [
        ("task", "--set task: write --set key.path=value"),
        ("=1", "--set =1: write --set key.path=value"),
        ("a..b=1", "--set a..b=1: write --set key.path=value"),
        ("a\n=1", "--set a\\n=1: write --set key.path=value"),
        ("name.x=1", "--set name.x=1: name: 'reach' (a string) has no key 'x'"),
        ("task.radius_m=", "--set task.radius_m=: no value given; write null for none"),
        ("name=a # b", "--set name=a # b: nothing may follow the value: '# b'; use quotes"),
        ("name=a: b", "--set name=a: b: the value must be a scalar, a [list] or a {key: value} mapping"),
        ("name=- b", "--set name=- b: the value must be a scalar, a [list] or a {key: value} mapping"),
        ("name=|", "--set name=|: the value must be a scalar, a [list] or a {key: value} mapping"),
        ("name=[1] 2", "--set name=[1] 2: nothing may follow the value: '2'; use quotes"),
        ("name=[1] # b", "--set name=[1] # b: nothing may follow the value: '# b'; use quotes"),
        ("name=[1", "--set name=[1: is not valid YAML: "),
        ("name=a\nb: 2", "--set name=a\\nb: 2: the value must be on one line"),
        ("name=!!int 3", "--set name=!!int 3: name: tags (!) are not allowed"),
        ("name=.nan", "--set name=.nan: name: .nan is not a finite number"),
        ("name={a: 1, a: 2}", "--set name={a: 1, a: 2}: name.a: duplicate key"),
        ("name=\udcff", "--set name=\\udcff: has a control or invalid character: '\\udcff'"),
        (
            "disturbances.2.x=1",
            "--set disturbances.2.x=1: disturbances: '2' is not an index of the list. Allowed: 0 to 1.",
        ),
        ("disturbances.-1=1", "--set disturbances.-1=1: disturbances: '-1' is not an index of the list."),
        ("disturbances.²=1", "--set disturbances.²=1: disturbances: '²' is not an index of the list."),
        ("a." * 20 + "b=1", "nested deeper than 16 levels"),
        ("a.b=" + "[" * 15 + "]" * 15, "nested deeper than 16 levels"),
    ],
)
def test_set_refused(assignment, reason):
    assert reason in set_message(assignment)


def test_dump_is_readable():
    tree = {
        "name": "reach it",
        "on": "yes",
        "empty": {},
        "none": None,
        "task": {"centre_m": (0.5, 0, 1e-07), "flag": True},
        "parts": [{"type": "a", "inner": {"x": 1}}, {"type": "b"}],
        "matrix": [[1, 2], []],
    }
    assert dump_yaml(tree) == (
        'name: reach it\n"on": "yes"\nempty: {}\nnone: null\ntask:\n  centre_m: [0.5, 0, 1.0e-07]\n'
        "  flag: true\nparts:\n  - type: a\n    inner:\n      x: 1\n  - type: b\n"
        "matrix:\n  - [1, 2]\n  - []\n"
    )
    assert dump_yaml({}) == "{}\n"


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_dump_refuses_what_is_not_finite(value):
    with pytest.raises(ValueError, match="not finite"):
        dump_yaml({"a": value})


def test_dump_refuses_foreign_types():
    with pytest.raises(TypeError, match="set cannot be written"):
        dump_yaml({"a": {1, 2}})


TEXTS = st.text(
    st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufeff\ufffe\uffff")
    | st.sampled_from("\n\t #:-'\"[]{},&*!|>%@`?0123e."),
    max_size=20,
)
KEYS = TEXTS.filter(lambda text: text and text.isprintable())
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63) + 1, 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | TEXTS
    | st.sampled_from(
        ["null", "~", "", "yes", "1e3", "0x1", ".nan", "<<", "---", "...", "2024-01-01", "a: b"]
    )
)
TREES = st.recursive(SCALARS, lambda inner: st.lists(inner) | st.dictionaries(KEYS, inner), max_leaves=20)


@settings(max_examples=200, deadline=None)
@given(st.dictionaries(KEYS, TREES, max_size=5))
def test_dump_round_trips(tree):
    assert repr(parse_yaml(dump_yaml(tree), "s.yaml").tree) == repr(tree)


def test_a_text_that_was_parsed_before_gives_a_tree_of_its_own():
    text = "a: {b: [1, 2]}\n"
    first = parse_yaml(text, "s.yaml")
    first.tree["a"]["b"].append(3)
    again = parse_yaml(text, "s.yaml")
    assert again.tree == {"a": {"b": [1, 2]}}
    assert (again.source, parse_yaml(text, "other.yaml").source) == ("s.yaml", "other.yaml")


def test_a_value_that_was_given_before_is_one_of_its_own():
    document = parse_yaml("a: 1\n", "s.yaml")
    first = set_value(document, "b=[1, 2]")
    first.tree["b"].append(3)
    assert set_value(document, "b=[1, 2]").tree == {"a": 1, "b": [1, 2]}
