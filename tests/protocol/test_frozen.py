"""A protocol is what its name says: what changed is refused by name, and has a way out."""

import json
import shutil

import pytest
from tiny_protocol import TINY, Here, wish, write_protocol

from surgsim.errors import SurgsimError
from surgsim.protocol import items
from surgsim.protocol.definition import load_protocol
from surgsim.protocol.freeze import changed_items, check_frozen, freeze, freeze_as, frozen_sha256
from surgsim.protocol.runs import Store
from surgsim.protocol.score import Means, score
from surgsim.protocol.seeds import commit_round, open_round
from surgsim.resources import resource_dir
from surgsim.runs.sources import ROOT


def test_the_shipped_protocol_is_as_it_was_frozen():
    protocol = load_protocol()
    assert changed_items(protocol) == [], "freeze the draft again: surgsim protocol freeze surgsim_v1"


def test_freezing_again_changes_nothing(tiny):
    before = tiny.lock.read_bytes()
    assert freeze(tiny) == (frozen_sha256(tiny), [])
    assert tiny.lock.read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "item"),
    [
        ("most: 2.0", "most: 2.5", "definition/thresholds"),
        ("levels: [0.1, 10.0]", "levels: [0.1, 9.0]", "definition/generators/circle"),
        ("radius_m: 0.0005", "radius_m: 0.0006", "scenario/circle/panda"),
        ("ports: [measured]", "ports: [measured, interaction_force]", "definition/tracks"),
        ("start_m: [0.0005, 0.65, -0.03]", "start_m: [0.0005, 0.65, -0.04]", "definition/arms"),
    ],
)
def test_a_changed_definition_is_refused_by_name(tiny, old, new, item):
    assert old in TINY
    changed = write_protocol(tiny.path.parent, TINY.replace(old, new, 1))
    with pytest.raises(SurgsimError, match="tiny is not what its name says: ") as caught:
        check_frozen(changed, "nominal", ("panda",))
    assert item in str(caught.value)
    assert "freeze the draft again" in str(caught.value)
    assert item in changed_items(changed)


def test_a_touched_asset_is_refused_where_it_is_used(tiny, tmp_path, monkeypatch):
    assets = tmp_path / "assets"
    shutil.copytree(resource_dir("assets"), assets)
    file = next((assets / "robots" / "panda").glob("*.xml"))
    file.write_text(file.read_text(encoding="utf-8") + "<!-- touched -->\n", encoding="utf-8")
    monkeypatch.setattr(items, "resource_dir", lambda name: tmp_path / name)
    with pytest.raises(
        SurgsimError, match=r"tiny is not what its name says: asset/robots/panda changed since"
    ):
        check_frozen(tiny, "nominal", ("panda",))
    assert check_frozen(tiny, "nominal", ("lwr4plus",)) == frozen_sha256(tiny)


def test_a_patched_metric_is_refused(tiny, tmp_path, monkeypatch):
    root = tmp_path / "surgsim"
    for name in ("metrics", "tasks", "scenario", "teleop"):
        shutil.copytree(ROOT / name, root / name)
    shutil.copy(ROOT / "verdict.py", root)
    monkeypatch.setattr(items, "ROOT", root)
    (root / "metrics" / "new.py").touch()
    catalog = root / "metrics" / "catalog.py"
    text = catalog.read_text(encoding="utf-8")
    catalog.write_text(text.replace("    accuracy,\n", "    accuracy,\n    new,\n"), encoding="utf-8")
    assert check_frozen(tiny, "nominal", ("panda",)) == frozen_sha256(tiny)  # a new metric is no change
    catalog.write_text(text.replace("else active)", "else trace)"), encoding="utf-8")
    with pytest.raises(SurgsimError, match=r"metric/metrics/catalog.py changed since it was frozen"):
        check_frozen(tiny, "nominal", ("panda",))
    catalog.write_text(text, encoding="utf-8")
    metric = root / "metrics" / "accuracy.py"
    metric.write_text(metric.read_text(encoding="utf-8").replace("1e3", "1e2"), encoding="utf-8")
    with pytest.raises(SurgsimError, match=r"metric/metrics/accuracy.py changed since it was frozen"):
        check_frozen(tiny, "nominal", ("panda",))


def test_a_change_gets_a_name_of_its_own_and_the_old_protocol_stays(tiny):
    old = frozen_sha256(tiny)
    copy, same = freeze_as(tiny, "tiny2")
    assert same != old  # its name counts
    changed = copy.path.read_text(encoding="utf-8").replace("most: 2.0", "most: 2.5")
    copy.path.write_text(changed, encoding="utf-8")
    copy = load_protocol(str(copy.path))
    freeze(copy)
    store = Store(folder=tiny.path.parent / "store")
    runner = Here()
    first, second = (score(wish(each), Means(store=store, runner=runner)) for each in (tiny, copy))
    assert first.content["protocol_sha256"] == old != second.content["protocol_sha256"]
    assert [row.metrics for row in first.rows] == [row.metrics for row in second.rows]
    with pytest.raises(SurgsimError, match=r"tiny2.yaml is there already"):
        freeze_as(tiny, "tiny2")


def test_what_cannot_be_frozen_leaves_no_file(tiny):
    with pytest.raises(SurgsimError):
        freeze_as(tiny, "Bad Name")
    assert not (tiny.path.parent / "Bad Name.yaml").exists()


def test_once_a_round_is_open_it_is_frozen_for_good(tiny):
    commit_round(tiny, "a", "a phrase that nobody guesses")
    changed = write_protocol(tiny.path.parent, TINY.replace("most: 2.0", "most: 2.5"))
    assert freeze(changed)[1] == [
        "definition/thresholds",
        "scenario/circle/lwr4plus",
        "scenario/circle/panda",
        "scheme/velocity_level/soft",
        "scheme/velocity_level/stiff",
    ]
    open_round(tiny, "a", "a phrase that nobody guesses")
    again = write_protocol(tiny.path.parent, TINY)
    with pytest.raises(
        SurgsimError, match="tiny is frozen for good, its round 'a' has been opened: definition/t"
    ):
        freeze(again)
    with pytest.raises(
        SurgsimError, match=r"changed since it was frozen. Put it back; or give the change a name"
    ):
        check_frozen(again, "nominal", ("panda",))


def test_no_draft_is_frozen_for_good(tiny):
    final = write_protocol(tiny.path.parent, TINY.replace("draft: true", "draft: false"))
    assert freeze(final)[1] == []  # whether it is a draft is no part of what it says
    again = write_protocol(
        tiny.path.parent, TINY.replace("draft: true", "draft: false").replace("most: 2.0", "most: 2.5")
    )
    with pytest.raises(SurgsimError, match="tiny is frozen for good, it says draft: false"):
        freeze(again)


def test_a_lock_that_is_missing_or_edited_is_refused(tiny):
    lock = json.loads(tiny.lock.read_text(encoding="utf-8"))
    lock["items"]["definition/thresholds"] = "0" * 64
    tiny.lock.write_text(json.dumps(lock), encoding="utf-8")
    with pytest.raises(SurgsimError, match=r"tiny.lock.json is damaged: its hash is not that of its items"):
        check_frozen(tiny, "nominal", ("panda",))
    tiny.lock.unlink()
    with pytest.raises(SurgsimError, match="tiny is not frozen: surgsim protocol freeze "):
        check_frozen(tiny, "nominal", ("panda",))
