"""Seeds of rounds: nobody knows them before, everybody can check them afterwards."""

import hashlib
import hmac
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from surgsim.errors import SurgsimError
from surgsim.protocol.seeds import (
    Seeds,
    any_open,
    commit_round,
    commitment,
    open_round,
    read_rounds,
    round_key,
    seeds_of,
)

PHRASE = "a phrase that nobody guesses"


def test_development_seeds_are_public_and_small():
    assert Seeds().of("random", 4) == Seeds().of("theatre", 4) == (0, 1, 2, 3)


def test_a_rounds_seeds_follow_from_its_key_by_hmac():
    key = hashlib.scrypt(PHRASE.encode(), salt=b"surgsim round tiny a", n=2**14, r=8, p=1, dklen=32)
    assert round_key(PHRASE, "tiny", "a") == key
    seeds = Seeds(kind="round", round="a", key=key.hex()).of("random", 3)
    expected = [
        hmac.new(key, f"surgsim seed random {i}".encode(), hashlib.sha256).digest()[:6] for i in range(3)
    ]
    assert list(seeds) == [int.from_bytes(each, "big") for each in expected]


@given(
    st.text("abcdef ", min_size=20).filter(lambda text: len(" ".join(text.split())) >= 16), st.integers(0, 50)
)
def test_seeds_differ_by_generator_and_grow_without_changing(text, count):
    seeds = Seeds(kind="round", round="a", key=hashlib.sha256(text.encode()).hexdigest())
    assert seeds.of("random", count + 1)[:count] == seeds.of("random", count)
    assert all(0 <= seed < 2**48 for seed in seeds.of("random", count))
    assert not set(seeds.of("random", 5)) & set(seeds.of("theatre", 5))


def test_phrase_protocol_and_round_all_count():
    keys = {
        round_key(PHRASE, "tiny", "a"),
        round_key(PHRASE, "tiny", "b"),
        round_key(PHRASE, "other", "a"),
        round_key(f"{PHRASE}!", "tiny", "a"),
    }
    assert len(keys) == 4
    assert round_key(f"  {PHRASE}\n", "tiny", "a") in keys  # a file ends in a line break


def test_a_round_is_committed_to_then_opened(tiny):
    found = commit_round(tiny, "2027-1", PHRASE)
    assert found == commitment(round_key(PHRASE, "tiny", "2027-1"))
    assert any_open(tiny) == ""
    with pytest.raises(SurgsimError, match="round '2027-1' is not open yet"):
        seeds_of(tiny, "2027-1")
    with pytest.raises(SurgsimError, match=f"this is not the phrase of the hash {found}"):
        open_round(tiny, "2027-1", "another phrase altogether")
    seeds = open_round(tiny, "2027-1", PHRASE)
    assert seeds == seeds_of(tiny, "2027-1")
    assert any_open(tiny) == "2027-1"
    written = "".join(path.read_text(encoding="utf-8") for path in tiny.path.parent.iterdir())
    assert PHRASE not in written


def test_a_key_that_is_not_the_published_one_is_refused(tiny):
    commit_round(tiny, "a", PHRASE)
    open_round(tiny, "a", PHRASE)
    rounds = read_rounds(tiny)
    rounds["a"]["key"] = "00" * 32
    tiny.rounds.write_text(json.dumps({"rounds": rounds}), encoding="utf-8")
    with pytest.raises(SurgsimError, match="the key of round 'a' is not the one that was published"):
        seeds_of(tiny, "a")


@pytest.mark.parametrize(
    ("name", "phrase", "told"),
    [
        ("a", "short", "the phrase has 5 letters: give at least 16"),
        ("development", PHRASE, "--round: 'development' is not allowed"),
        ("A b", PHRASE, "--round: 'A b' is not allowed"),
    ],
)
def test_what_cannot_be_a_round_is_refused(tiny, name, phrase, told):
    with pytest.raises(SurgsimError, match=told):
        commit_round(tiny, name, phrase)


def test_a_round_is_not_committed_to_twice_and_an_unknown_one_is_refused(tiny):
    commit_round(tiny, "a", PHRASE)
    with pytest.raises(SurgsimError, match="'a' is there already"):
        commit_round(tiny, "a", PHRASE)
    with pytest.raises(SurgsimError, match=r"'b' is no round of tiny. Known: development, a"):
        open_round(tiny, "b", PHRASE)


def test_a_damaged_file_of_rounds_is_refused(tiny):
    tiny.rounds.write_text("{", encoding="utf-8")
    with pytest.raises(SurgsimError, match=r"rounds.json is damaged"):
        seeds_of(tiny, "a")
