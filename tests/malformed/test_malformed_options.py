"""Wrong words on the command line, suites and controllers: refused before anything is run or written."""

import os
import shlex
from pathlib import Path

import pytest

S, LONG = "circle_lwr4plus", "x" * 5000
SETTINGS = {
    "a": "write --set key.path=value",
    "=1": "write --set key.path=value",
    ".=1": "write --set key.path=value",
    "task..radius_m=1": "write --set key.path=value",
    "task\n.radius_m=1": "write --set key.path=value",
    "task.radius_m=": "no value given",
    "task.radius_m=[1": "is not valid YAML",
    "task.radius_m={": "is not valid YAML",
    "task.radius_m=a: b": "must be a scalar, a [list] or a {key: value} mapping",
    "task.radius_m=[1] 2": "nothing may follow the value: '2'",
    "task.radius_m=*a": "anchors (&) and aliases (*) are not allowed",
    "task.radius_m=!!float 1": "tags (!) are not allowed",
    "task.radius_m=\n1": "the value must be on one line",
    "task.radius_m=\0": "has a control or invalid character",
    "task.radius_m=\ud800": "has a control or invalid character",
    "task.radius_m=" + "[" * 500: "nested deeper than 16 levels",
    "task.radius_m=" + LONG * 60: "is larger than 256 KiB",
    "a." * 50 + "b=1": "nested deeper than 16 levels",
    "task.radius_m=.nan": "task.radius_m: .nan is not a finite number",
    "task.radius_m=1e16": "task.radius_m: 1e+16 is not allowed",
    "task.radius_m=yes": "task.radius_m: 'yes' (a string) is not a number",
    "task.radios_m=1": "Did you mean 'radius_m'?",
    "task.0=1": "task.0: unknown key",
    "name.x=1": "name: 'circle_lwr4plus' (a string) has no key 'x'",
    "disturbances.0=1": "disturbances: {0: 1} (a mapping) is not a list",
    "start.posture_rad.7=1": "'7' is not an index of the list. Allowed: 0 to 6.",
    "start.posture_rad.-1=1": "'-1' is not an index of the list",
    "controller=nothing": "--controller: 'nothing' is not a shipped controller",
    "task=null": "task: null (no value) is not a mapping",
    "task=[]": "task: [] (a list) is not a mapping",
}
OPTIONS = {
    f"check {S} --seed -1": "--seed: -1 is not allowed: must be 0 or more",
    f"check {S} --seed {2**63}": f"--seed: {2**63} is out of range",
    f"check {S} --controller ''": "--controller: '' is not a shipped controller",
    f"check {S} --controller vprn": "Did you mean 'vprnn'?",
    f"check {S} --controller {LONG}": "is not a shipped controller",
    f"check {S} --controller .": "--controller: '.' is not a shipped controller",
    f"check {S} --controller /dev/zero": "/dev/zero: is a folder or a device",
    f"check {S} --controller nothing.yaml": "nothing.yaml: cannot be read",
    f"check {S} --controller scenario.yaml": "scenario.yaml:1: resolver: missing.",
    f"run {S} --out /dev/null": "/dev/null is a file; --out names a folder",
    f"run {S} --out ''": "'' is not a path",
    f"run {S} --out {LONG}": "cannot be used: File name too long",
    f"run {S} --out '\0'": "cannot be used: embedded null byte",
    f"run {S} --out .": "which is not a run's; choose another --out",
    f"run {S} --out loop": "cannot be used: Too many levels of symbolic links",
    f"compare {S} --shard 0/3": "--shard: '0/3' is not I/N",
    f"compare {S} --shard 4/3": "--shard: '4/3' is not I/N",
    f"compare {S} --shard ²/3": "--shard: '²/3' is not I/N",
    f"compare {S} --shard 1/{'9' * 5000}": "is not I/N with 1 <= I <= N <= 10000",
    f"compare {S} --shard ''": "--shard: '' is not I/N",
    f"compare {S} --shard 1/2/3": "--shard: '1/2/3' is not I/N",
    f"compare {S} --shard=-1/3": "--shard: '-1/3' is not I/N",
    f"compare {S} --seeds ''": "--seeds: '' is not a list of seeds",
    f"compare {S} --seeds a": "--seeds: 'a' is not a list of seeds",
    f"compare {S} --seeds 3:1": "--seeds: '3:1' must name between one and 100000 different seeds",
    f"compare {S} --seeds 1,1": "--seeds: '1,1' must name",
    f"compare {S} --seeds 0:2,1": "--seeds: '0:2,1' must name",
    f"compare {S} --seeds 0:999999999": "--seeds: '0:999999999' must name",
    f"compare {S} --seeds 1;2": "--seeds: '1;2' is not a list of seeds",
    f"compare {S} --seeds -1": "--seeds: '-1' is not a list of seeds",
    f"compare {S} --seeds {'9' * 40}": "is not a list of seeds",
    f"compare {S} --seeds {LONG}": "is not a list of seeds",
    f"compare {S} --controllers ''": "'' is not a shipped controller",
    f"compare {S} --controllers ,": "'' is not a shipped controller",
    f"compare {S} --controllers vprnn,vprnn": "two runs of the suite are both",
    f"compare {S} {S}": "two runs of the suite are both",
    f"compare quick {S}": "give one suite, or scenarios; not both",
    f"compare {S} --jobs 0": "--jobs: 0 is not allowed",
    f"compare {S} --metric speed": "'speed' is not a metric. Known:",
    f"compare {S} --address here:1": "--address is for --engine ray",
    f"compare {S} --out .": "holds files that are not batch results",
    f"compare {S} --out scenario.yaml": "cannot write scenario.yaml: File exists",
    f"compare {S} --out '\0'": "cannot be used: embedded null byte",
    "compare nothing": "'nothing' is not a shipped suite or scenario",
    "tune vprn --scenario x --budget 9": "'vprn' is not a shipped controller",
    f"tune vprnn --scenario {LONG} --budget 9": "is not a shipped scenario",
    f"tune vprnn --scenario {S} --budget 9 --keys {LONG}": "is not a gain of vprnn",
    f"tune vprnn --scenario {S} --budget 9 --keys ''": "--keys: '' is not a gain of vprnn",
    f"tune vprnn --scenario {S} --budget 5": "--budget: 5 is not allowed: must be 6 or more",
    f"tune vprnn --scenario {S} --budget -{'9' * 50}": "is not allowed: must be 6 or more",
    f"tune vprnn --scenario {S} --budget 9 --seed {2**32}": f"--seed: {2**32} is not allowed",
    f"tune vprnn --scenario {S} --budget 9 --seeds 3:1": "--seeds: '3:1' must name",
    f"tune vprnn --scenario {S} --budget 9 --set a": "write --set key.path=value",
    f"tune vprnn --scenario {S} --budget 9 --out .": "which is not of this tuning; choose another --out",
    f"tune vprnn --scenario {S} --budget 9 --out scenario.yaml": "cannot write scenario.yaml: File exists",
    f"tune vprnn --scenario {S} --budget 9 --out '\0'": "cannot be used: embedded null byte",
    "report nothing": "nothing is not a folder",
    "report scenario.yaml": "scenario.yaml is not a folder",
    "report .": "holds no runs.csv",
    f"report {LONG}": "cannot be used: File name too long",
    "inspect nothing": "nothing: cannot be read: No such file or directory",
    "inspect .": "recording.rrd: cannot be read: No such file or directory",
    "inspect ''": "'' is not a path",
    "inspect '\0'": "cannot be used: embedded null byte",
    "inspect 'a\nb'": "a\\nb: cannot be read",
    "inspect /dev/zero": "/dev/zero: is not a file",
    "inspect pipe": "pipe: is not a file",
    "inspect loop": "loop: cannot be used: Too many levels of symbolic links",
    "inspect a b c": "inspect takes one recording, two, or a batch's folder",
    "inspect . --run x": "holds no runs.csv",
    "inspect scenario.yaml": "scenario.yaml: is not a rerun recording",
    "reproduce vprn": (
        "'vprn' is not a study. Known: bilateral_schemes, manipulability_validation, passive_teleoperation, "
        "vprnn. Did you mean 'vprnn'?"
    ),
    f"reproduce {LONG}": "is not a study",
    "reproduce vprnn --out scenario.yaml": "scenario.yaml is a file; --out names a folder",
    "reproduce vprnn --out .": "which is not a study's; choose another --out",
    "reproduce vprnn --out '\0'": "cannot be used: embedded null byte",
    "bench --duration nan": "bench needs a duration of at least 3 s",
    "bench --duration inf": "at most 3600 s",
    "bench --duration 1e300": "at most 3600 s",
    "bench --repeat 0": "and at least one repeat",
    "bench --only tick": "'tick' is not a section of bench. Known: batch, libraries,",
    "bench --cases circle/vprn": "Did you mean 'circle/vprnn'?",
    "bench --only stages --keep kept.json": "are for the section ticks",
    "bench --only ticks --against nowhere.json": "nowhere.json: No such file or directory",
}
GOOD_SUITE = f"name: made\nscenarios: [{S}]\n"
SUITES = {
    "no name": (f"scenarios: [{S}]\n", "suite.yaml:1: name: missing. Expected a string."),
    "name is a path": (
        f"name: ../made\nscenarios: [{S}]\n",
        "suite.yaml:1: name: '../made' must be lower-case",
    ),
    "no scenarios": ("name: made\nscenarios: []\n", "suite.yaml:2: scenarios: [] has 0 items."),
    "scenarios null": ("name: made\nscenarios:\n", "suite.yaml:2: scenarios: null (no value)"),
    "scenarios text": (
        f"name: made\nscenarios: {S}\n",
        "suite.yaml:2: scenarios: 'circle_lwr4plus' (a string)",
    ),
    "scenario unknown": ("name: made\nscenarios: [circle_lwr4]\n", "'circle_lwr4' is not a shipped scenario"),
    "scenario missing": ("name: made\nscenarios: [a/b.yaml]\n", "a/b.yaml: cannot be read"),
    "scenario itself": ("name: made\nscenarios: [suite.yaml]\n", "suite.yaml:1: "),
    "scenario device": ("name: made\nscenarios: [/dev/zero]\n", "/dev/zero: is a folder or a device"),
    "scenario pipe": ("name: made\nscenarios: [pipe.yaml]\n", "pipe.yaml: is a folder or a device"),
    "scenario twice": (f"name: made\nscenarios: [{S}, {S}]\n", "two runs of the suite are both"),
    "controllers empty": (GOOD_SUITE + "controllers: []\n", "suite.yaml:3: controllers: [] has 0 items."),
    "controller unknown": (GOOD_SUITE + "controllers: [vprn]\n", "'vprn' is not a shipped controller"),
    "controller number": (GOOD_SUITE + "controllers: [3]\n", "suite.yaml:3: controllers.0: 3 (a number)"),
    "seeds number": (GOOD_SUITE + "seeds: 3\n", "suite.yaml:3: seeds: 3 (a number) is not a string"),
    "seeds text": (GOOD_SUITE + "seeds: few\n", "suite.yaml:3: seeds: 'few' is not a list of seeds"),
    "seeds backwards": (GOOD_SUITE + 'seeds: "5:2"\n', "suite.yaml:3: seeds: '5:2' must name"),
    "grid list": (GOOD_SUITE + "grid: [1, 2]\n", "suite.yaml:3: grid: [1, 2] (a list) is not a mapping"),
    "grid empty": (GOOD_SUITE + "grid: {task.radius_m: []}\n", "grid.task.radius_m: [] has 0 items."),
    "grid scalar": (
        GOOD_SUITE + "grid: {task.radius_m: 1}\n",
        "grid.task.radius_m: 1 (a number) is not a list",
    ),
    "grid key": (GOOD_SUITE + "grid: {task.radios_m: [0.01]}\n", "Did you mean 'radius_m'?"),
    "grid value": (GOOD_SUITE + "grid: {task.radius_m: [0.01, wide]}\n", "'wide' (a string) is not a number"),
    "grid part": (GOOD_SUITE + "grid: {task.type: [circle, square]}\n", "'square' is not a task"),
    "grid seed": (GOOD_SUITE + "grid: {seed: [1, 2]}\n", "seed cannot be in grid or settings"),
    "grid no path": (GOOD_SUITE + "grid: {task..radius_m: [1]}\n", "write --set key.path=value"),
    "grid huge": (
        GOOD_SUITE + "grid: {" + ", ".join(f"a{i}: [1, 2, 3, 4]" for i in range(12)) + "}\n",
        "has 16777216 runs",
    ),
    "settings text": (
        GOOD_SUITE + "settings: task.radius_m=1\n",
        "suite.yaml:3: settings: 'task.radius_m=1' (a string)",
    ),
    "setting wrong": (GOOD_SUITE + "settings: [task.radius_m=-1]\n", "task.radius_m: -1 is not allowed"),
    "setting no value": (GOOD_SUITE + "settings: [task]\n", "write --set key.path=value"),
    "record yes": (
        GOOD_SUITE + "record: yes\n",
        "suite.yaml:3: record: 'yes' (a string) is not true or false",
    ),
    "unknown key": (GOOD_SUITE + "seed: 3\n", "suite.yaml:3: seed: unknown key (value 3)."),
    "duplicate key": (GOOD_SUITE + "name: other\n", "suite.yaml:3: name: duplicate key"),
    "anchor": (GOOD_SUITE + "settings: &a [x=1]\n", "suite.yaml:3: settings: anchors (&)"),
    "two documents": (GOOD_SUITE + "---\n" + GOOD_SUITE, "suite.yaml:3: a second document starts here"),
    "tabs": (GOOD_SUITE + "grid:\n\ta: [1]\n", "suite.yaml:4: is not valid YAML"),
    "empty": ("", "suite.yaml:1: the file is empty"),
    "list": (f"- {S}\n", "suite.yaml:1: the top level is"),
    "nul": (GOOD_SUITE + "\0", "suite.yaml:3: has a control or invalid character"),
}


def _controller(text: str) -> str:
    return f"name: made\nresolver: {text}\ntorque_law: {{type: joint_impedance}}\n"


CONTROLLERS = {
    "empty": ("", "made.yaml:1: the file is empty"),
    "no resolver": ("name: made\n", "made.yaml:1: resolver: missing."),
    "no name": ("resolver: {type: pinv}\n", "made.yaml:1: name: missing."),
    "name is a path": (
        _controller("{type: pinv}").replace("made", "a/b"),
        "made.yaml:1: name: 'a/b' must be",
    ),
    "resolver text": (_controller("pinv"), "made.yaml:2: resolver: 'pinv' (a string) is not a mapping"),
    "resolver unknown": (
        _controller("{type: pinvv}"),
        "made.yaml:2: resolver.type: 'pinvv' is not a resolver.",
    ),
    "resolver key": (
        _controller("{type: pinv, gain: 1}"),
        "made.yaml:2: resolver.gain: unknown key (value 1).",
    ),
    "resolver null": (_controller("null"), "made.yaml:2: resolver: null (no value)"),
    "negative gain": (
        _controller("{type: pinv, k_tip: -1}"),
        "made.yaml:2: resolver.k_tip: -1 is not allowed",
    ),
    "plane": (
        _controller("{type: qp, planes: [{normal: [0, 0, 0], offset_m: 1}]}"),
        "normal must not be zero",
    ),
    "policy unknown": (_controller("{type: policy, name: nobody}"), "'nobody' is not a policy"),
    "a scenario": (f"name: made\ncontroller: vprnn\nscenarios: [{S}]\n", "made.yaml:1: resolver: missing."),
    "list": ("- type: pinv\n", "made.yaml:1: the top level is"),
    "alias": (_controller("*r"), "made.yaml:2: resolver: anchors (&) and aliases (*)"),
}


@pytest.fixture(autouse=True)
def _surroundings(tmp_path: Path) -> None:
    (tmp_path / "scenario.yaml").write_text("name: made\n")
    (tmp_path / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "pipe")
    os.mkfifo(tmp_path / "pipe.yaml")


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda text: repr(text)[1:40])
def test_settings(setting: str, refused) -> None:
    line = refused("check", S, "--set", setting)
    assert SETTINGS[setting] in line
    assert line.startswith("--")


@pytest.mark.parametrize("words", OPTIONS, ids=lambda text: repr(text)[1:60])
def test_options(words: str, refused, tmp_path) -> None:
    before = sorted(path.name for path in tmp_path.iterdir())
    assert OPTIONS[words] in refused(*shlex.split(words))
    assert sorted(path.name for path in tmp_path.iterdir()) == before


@pytest.mark.parametrize("name", SUITES)
def test_suites(name: str, refused, tmp_path) -> None:
    text, reason = SUITES[name]
    (tmp_path / "suite.yaml").write_text(text)
    line = refused("compare", "suite.yaml", "--out", "out")
    assert reason in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controllers(name: str, refused, tmp_path) -> None:
    text, reason = CONTROLLERS[name]
    (tmp_path / "made.yaml").write_text(text)
    assert reason in refused("check", S, "--controller", "made.yaml")
