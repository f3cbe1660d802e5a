"""`surgsim protocol` and `surgsim seeds` as they are typed."""

import json

import pytest

PHRASE = "a phrase that nobody guesses"


def test_a_protocol_is_shown_checked_and_frozen(warm, tiny, tmp_path):
    shown = warm.run(["protocol", "show", str(tiny.path)], folder=tmp_path)
    assert shown.returncode == 0
    assert "tiny (draft): a circle of a fifth of a second" in shown.stdout
    assert "velocity_level" in shown.stdout
    checked = warm.run(["protocol", "check", str(tiny.path)], folder=tmp_path)
    assert checked.returncode == 0
    tiny.path.write_text(tiny.path.read_text(encoding="utf-8").replace("most: 2.0", "most: 2.5"))
    checked = warm.run(["protocol", "check", str(tiny.path), "--json"], folder=tmp_path)
    assert checked.returncode == 1
    assert "definition/thresholds" in json.loads(checked.stdout)["changed"]
    refused = warm.run(["score", "pinv", "--protocol", str(tiny.path)], folder=tmp_path)
    assert refused.returncode == 2
    assert "surgsim: tiny is not what its name says: definition/thresholds, " in refused.stderr
    frozen = warm.run(["protocol", "freeze", str(tiny.path)], folder=tmp_path)
    assert "changed: definition/thresholds" in frozen.stdout
    assert warm.run(["protocol", "check", str(tiny.path)], folder=tmp_path).returncode == 0


def test_a_new_name_copies_an_old_definition(warm, tiny, tmp_path):
    words = ["protocol", "freeze", "tiny2", "--from", str(tiny.path)]
    done = warm.run(words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tiny.path.parent / "tiny2.lock.json").is_file()
    assert warm.run(words, folder=tmp_path).returncode == 2
    alone = warm.run(["protocol", "show", "--from", "x"], folder=tmp_path)
    assert "--from is for: surgsim protocol freeze NEW_NAME --from NAME" in alone.stderr


def test_a_round_from_its_hash_to_its_seeds(warm, tiny, tmp_path):
    phrase = tmp_path / "phrase.txt"
    phrase.write_text(f"{PHRASE}\n", encoding="utf-8")

    def seeds(action, *words):
        given = ["seeds", action, "--protocol", str(tiny.path), "--round", "a", *words]
        return warm.run(given, folder=tmp_path)

    committed = seeds("commit", "--phrase-file", str(phrase))
    assert committed.returncode == 0, committed.stderr
    assert "not open yet" in seeds("show").stderr
    opened = seeds("open", "--phrase-file", str(phrase), "--json")
    told = json.loads(opened.stdout)
    assert len(told["seeds"]["circle"]) == 2
    assert seeds("show", "--generator", "circle").stdout == (
        f"circle: {', '.join(map(str, told['seeds']['circle']))}\n"
    )
    assert "'square' is not a generator" in seeds("show", "--generator", "square").stderr
    assert PHRASE not in committed.stdout + opened.stdout + tiny.rounds.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["commit", "--round", "a"],
            "the phrase is asked for on a terminal; give --phrase-file FILE elsewhere",
        ),
        (["commit", "--round", "a", "--phrase-file", "none"], "--phrase-file: none: "),
        (["show", "--round", "b"], "'b' is no round of surgsim_v1. Known: development."),
    ],
)
def test_what_is_wrong_is_told(warm, tmp_path, words, told):
    done = warm.run(["seeds", *words], folder=tmp_path)
    assert done.returncode == 2
    assert told in done.stderr


def test_development_seeds_are_shown(warm, tmp_path):
    done = warm.run(["seeds", "show", "--round", "development", "--generator", "loads"], folder=tmp_path)
    assert done.stdout == "loads: 0, 1, 2, 3, 4, 5\n"
