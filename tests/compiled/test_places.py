"""Where kernels are kept: nowhere that another user could write to, never in the working folder."""

import os
import tempfile
from pathlib import Path

import pytest

import surgsim
from surgsim.compiled import places

BESIDE = Path(surgsim.__file__).parent / "__pycache__" / "kernels"


@pytest.fixture(autouse=True)
def nothing_set(monkeypatch):
    """No folders given by the surroundings, and no answer from an earlier test."""
    for name in ("XDG_CACHE_HOME", "TMPDIR", "TEMP", "TMP"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(places.numba.config, "CACHE_DIR", "", raising=False)
    monkeypatch.setattr(tempfile, "tempdir", None)
    places.places.cache_clear()
    yield
    places.places.cache_clear()


def test_beside_the_source_then_the_users_then_temporary(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    home, scratch = tmp_path / ".cache/surgsim/kernels", Path(f"/tmp/surgsim-kernels-{os.getuid()}")
    assert places.places() == (BESIDE, home, scratch)


def test_what_a_person_gives_to_numba_comes_first(monkeypatch, tmp_path):
    monkeypatch.setattr(places.numba.config, "CACHE_DIR", str(tmp_path))
    assert places.places()[:2] == (tmp_path / "surgsim", BESIDE)
    assert places.prepared(tmp_path / "surgsim")


def test_a_user_without_a_home_gets_no_folder_named_tilde(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert all(place.is_absolute() for place in places.places())
    assert len(places.places()) == 2


def test_the_working_folder_is_no_temporary_one(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))  # what is found when nothing else can be written
    assert not any(tmp_path in place.parents for place in places.places())
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # but here somebody means it
    places.places.cache_clear()
    assert places.places()[-1].parent == tmp_path


def test_no_temporary_folder_at_all(monkeypatch):
    def none():
        raise FileNotFoundError

    monkeypatch.setattr(tempfile, "gettempdir", none)
    assert len(places.places()) == 2


def test_a_folder_is_made_for_its_user_alone(tmp_path):
    place = tmp_path / "a" / "kernels"
    assert not places.usable(place)
    assert places.prepared(place)
    assert place.stat().st_mode & 0o777 == 0o700
    assert places.usable(place)


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o722])
def test_a_folder_that_others_can_write_to_is_not_used(tmp_path, mode):
    place = tmp_path / "kernels"
    place.mkdir()
    place.chmod(mode)
    assert not places.usable(place)
    assert not places.prepared(place)


def test_a_link_and_a_file_are_not_used(tmp_path):
    (tmp_path / "real").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "real")
    (tmp_path / "file").write_bytes(b"")
    assert not places.prepared(tmp_path / "link")
    assert not places.prepared(tmp_path / "file")
    assert not places.prepared(tmp_path / "file" / "kernels")


def test_a_folder_of_another_user_is_not_used(tmp_path, monkeypatch):
    place = tmp_path / "kernels"
    assert places.prepared(place)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert not places.usable(place)
