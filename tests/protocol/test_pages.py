"""Passport and leaderboard as a person gets them."""

import csv
import re
from contextlib import contextmanager
from dataclasses import replace

import pytest
from tiny_protocol import Here

from surgsim.protocol.board import Board, make_board
from surgsim.protocol.passport_files import write_passport
from surgsim.protocol.passport_page import passport_page
from surgsim.protocol.ranking import ordered, place_of
from surgsim.protocol.reading import baselines_of, scores_below, why_none_beside
from surgsim.protocol.score import FILES, Means
from surgsim.protocol.score_text import axis_told, figure_told, sentence, tuning_told
from surgsim.protocol.seeds import Seeds


@contextmanager
def silent(label):
    """No progress."""
    yield lambda done, total, outcome: None


@pytest.fixture(scope="module")
def board(whole, tmp_path_factory):
    """The tiny protocol's leaderboard: its folder and its scores."""
    protocol, _, store = whole
    out = tmp_path_factory.mktemp("board")
    wanted = Board(
        protocol=protocol, tracks=tuple(protocol.config.tracks), arms=("panda",), seeds=Seeds(), out=out
    )
    return out, make_board(wanted, Means(store=store, runner=Here()), silent, lambda text: None)


def test_the_page_needs_nothing_but_itself_and_says_where_it_comes_from(whole):
    protocol, made, _ = whole
    page = passport_page(made, [], protocol.config)
    assert not re.findall(r"(?:src|href)=\"(?!data:)[^\"]+\"", page)
    for key in ("protocol_sha256", "scorecard_sha256", "rows_sha256"):
        assert made.content[key] in page
    assert "1 of 4 runs failed" in page
    assert "unknown payload" in page


def test_names_cannot_break_the_page(whole):
    protocol, made, _ = whole
    controller = {**made.content["controller"], "name": '<script>"a</script>'}
    page = passport_page(
        replace(made, content={**made.content, "controller": controller}), [], protocol.config
    )
    assert "<script" not in page


def test_the_same_score_gives_the_same_files(whole, tmp_path):
    protocol, made, _ = whole
    for name in ("a", "b"):
        write_passport(tmp_path / name, made, [made], protocol.config)
    for suffix in ("html", "pdf", "png"):
        first, second = ((tmp_path / name / f"passport.{suffix}").read_bytes() for name in ("a", "b"))
        assert first == second
        assert len(first) > 1000


def test_the_leaderboard_has_a_folder_for_each_entry_and_a_page(board):
    out, made = board
    assert [score.name for score in made] == ["joint_impedance", "pinv", "rcm_inverse_dynamics", "pinv_soft"]
    folders = {path.parent.relative_to(out).as_posix() for path in out.rglob("score.json")}
    assert folders == {
        "nominal/joint_impedance",
        "nominal/pinv",
        "port_tracked/rcm_inverse_dynamics",
        "velocity_level/pinv_soft",
    }
    assert all(
        {path.name for path in (out / folder).iterdir()} == FILES - {"passport.png"} for folder in folders
    )
    page, text = ((out / name).read_text(encoding="utf-8") for name in ("index.html", "README.md"))
    for folder in folders:
        assert f'href="{folder}/passport.html"' in page
        assert f"({folder}/passport.html)" in text
    with (out / "table.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["track"], row["controller"]) for row in rows] == [
        ("nominal", "joint_impedance"),
        ("nominal", "pinv"),
        ("port_tracked", "rcm_inverse_dynamics"),
        ("velocity_level", "pinv_soft"),
    ]
    assert {len(row["scorecard_sha256"]) for row in rows} == {64}


def test_it_is_made_again_in_place_and_the_same(board, whole):
    out, _ = board
    protocol, _, store = whole
    before = {
        path: path.read_bytes() for path in out.rglob("*") if path.is_file() and path.name != "timing.json"
    }
    wanted = Board(
        protocol=protocol, tracks=tuple(protocol.config.tracks), arms=("panda",), seeds=Seeds(), out=out
    )
    runner = Here()
    make_board(wanted, Means(store=store, runner=runner), silent, lambda text: None)
    assert runner.count == 0
    assert {path: path.read_bytes() for path in before} == before


def test_a_passport_stands_beside_the_baselines_of_its_track(board, whole):
    out, made = board
    protocol = whole[0]
    found = baselines_of(made[0], scores_below(out), protocol)
    assert [score.name for score in found] == ["pinv"]
    assert "pinv" in (out / "nominal" / "joint_impedance" / "passport.html").read_text(encoding="utf-8")
    assert baselines_of(made[2], scores_below(out), protocol) == []


def test_it_is_told_why_nothing_stands_beside_a_score(board):
    _, made = board
    score, former = made[0], replace(made[1], content={**made[1].content, "protocol_sha256": "0" * 64})
    name, mine = score.content["protocol"], score.content["protocol_sha256"][:8]
    told = why_none_beside(score, [former])
    assert told == f"no score is drawn beside it: those are of {name} 00000000, this is of {mine}"
    assert why_none_beside(score, made[2:]).endswith("none is of its track, seeds and arms")


def test_a_baseline_of_more_arms_is_cut_to_those_of_the_score(scored, whole):
    protocol = whole[0]
    two = scored("pinv", arms=("panda", "lwr4plus"))
    one = scored("joint_impedance")
    (cut,) = baselines_of(one, [two], protocol)
    assert {row.arm for row in cut.rows} == {"panda"}
    assert cut.scorecard["runs"] == 4
    assert cut.scorecard["figures"] == scored("pinv").scorecard["figures"]
    assert baselines_of(two, [one], protocol) == []


def test_who_is_not_told_apart_shares_a_place(whole):
    protocol, made, _ = whole

    def like(name, held, done):
        figures = {**made.scorecard["figures"], "levels_held": {"value": held}, "done": {"value": done}}
        card = {**made.scorecard, "figures": figures}
        controller = {**made.content["controller"], "name": name}
        return replace(made, content={**made.content, "scorecard": card, "controller": controller})

    scores = [like("d", None, 0.0), like("b", 0.80, 0.7), like("a", 0.82, 0.72), like("c", 0.7, 1.0)]
    places, best = place_of(scores, protocol.config), ordered(scores, protocol.config)
    assert [score.name for score in best] == ["a", "b", "c", "d"]
    assert [places[id(score)] for score in best] == [1, 1, 3, 4]
    # Two steps below the margin are more than one: by levels alone, "low" would stand above "done".
    scores = [like("high", 0.43, 0.62), like("low", 0.40, 0.62), like("done", 0.385, 0.71)]
    places, best = place_of(scores, protocol.config), ordered(scores, protocol.config)
    assert [score.name for score in best] == ["done", "high", "low"]
    assert [places[id(score)] for score in best] == [1, 2, 2]


def test_words_say_failures_first(whole):
    _, made, _ = whole
    first, second, *_ = sentence(made)
    assert first.startswith("joint_impedance on panda: 1 of 4 runs failed (")
    assert second == "It holds every level of 0 of 1 axis."
    assert axis_told(made.scorecard["axes"][0]).startswith("fails at 10: 1 of 1 run, ")
    assert figure_told({"value": None, "low": None, "high": None, "note": "6 of 9 runs failed"}) == (
        "-",
        "6 of 9 runs failed",
    )
    assert figure_told({"value": 1.0, "low": 0.5, "high": None, "note": ""}) == ("1.00", "0.500 to open")
    assert figure_told({"value": 0.0, "low": 2.8e-17, "high": 0.2, "note": ""}) == ("0", "0 to 0.200")
    assert tuning_told({"runs": None, "source": "unknown"}) == "not declared"
    assert tuning_told({"runs": 480, "source": "surgsim tune"}) == "480 runs, surgsim tune"
