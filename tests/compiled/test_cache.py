"""What is kept is used again, whatever happened to it meanwhile."""

import fcntl
import hashlib
import os
import pickle
import subprocess
import sys
import time

import pytest

from surgsim.compiled import cache
from surgsim.compiling import listening

KERNEL = "from surgsim.compiled import compiled\n@compiled\ndef twice(x):\n    return 2.0 * x\n"


def _sealed(payload):
    return cache._MAGIC + hashlib.sha256(payload).digest() + payload


DAMAGE = {
    "empty": lambda content: b"",
    "cut": lambda content: content[:40],
    "cut at the end": lambda content: content[:-1],
    "garbage": lambda content: os.urandom(len(content)),
    "one bit": lambda content: content[:-9] + bytes([content[-9] ^ 1]) + content[-8:],
    "another format": lambda content: pickle.dumps("0.99") + pickle.dumps((None, {})),
    "not unpicklable": lambda content: _sealed(b"nonsense"),
    "a pickle of something else": lambda content: _sealed(pickle.dumps(("a", "b"))),
    "of a class that is gone": lambda content: _sealed(b"cno_such_module\nNoSuchClass\n."),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_entry_is_compiled_and_written_again(workshop, damage):
    workshop.write(user=KERNEL)
    workshop.run("user").twice(1.0)
    for entry in workshop.files():
        entry.write_bytes(damage(entry.read_bytes()))
    assert workshop.run("user").twice(1.5) == 3.0
    assert workshop.compiled == ["twice"]
    assert workshop.run("user").twice(1.5) == 3.0
    assert workshop.compiled == []


def test_a_folder_in_the_place_of_an_entry_stops_nothing(workshop):
    workshop.write(user=KERNEL)
    workshop.run("user").twice(1.0)
    for entry in workshop.files():
        entry.unlink()
        entry.mkdir()
    assert workshop.run("user").twice(1.5) == 3.0


def test_only_whole_entries_are_left(workshop):
    workshop.write(user=KERNEL)
    workshop.run("user").twice(1.0)
    assert {path.suffix for path in workshop.kept.iterdir()} == {cache.SUFFIX}


def test_the_entries_used_last_stay(workshop, monkeypatch):
    monkeypatch.setattr(cache, "MOST_ENTRIES", 5)
    workshop.write(user=KERNEL)
    workshop.run("user").twice(1.0)
    entries = {path.name for path in workshop.files()}
    for age_s in (10, 20, 30, 7_200):
        for suffix in (cache.SUFFIX, ".part", ".lock"):
            old = workshop.kept / f"old{age_s}{suffix}"
            old.write_bytes(b"")
            os.utime(old, (time.time() - age_s,) * 2)
    workshop.write(user=KERNEL.replace("2.0", "3.0"))
    workshop.run("user").twice(1.0)
    left = {path.name for path in workshop.kept.iterdir()}
    assert {f"old{age_s}{suffix}" for age_s in (10, 20, 30) for suffix in (".part", ".lock")} < left
    assert len([name for name in left if name.endswith(cache.SUFFIX)]) == 5
    assert {*entries, f"old10{cache.SUFFIX}"} < left


def test_a_use_keeps_an_old_entry(workshop):
    workshop.write(user=KERNEL)
    workshop.run("user").twice(1.0)
    (entry,) = set(workshop.files()) - set(workshop.entries())
    os.utime(entry, (0, 0))
    workshop.run("user").twice(1.0)
    assert time.time() - entry.stat().st_mtime < 60


def test_without_any_place_it_works_and_says_so_once(workshop, monkeypatch, capsys):
    workshop.kept.write_bytes(b"a file in the way")
    monkeypatch.setattr(cache, "_complained", False)
    workshop.write(user=KERNEL + "\n@compiled\ndef thrice(x):\n    return 3.0 * x\n")
    module = workshop.run("user")
    assert (module.twice(1.0), module.thrice(1.0)) == (2.0, 3.0)
    why = f"none of these folders can be written: {workshop.kept}"
    assert capsys.readouterr().err == f"surgsim: kernels are compiled at every start: {why}\n"


def test_the_next_place_is_taken_when_one_cannot_be_written(workshop, monkeypatch, tmp_path):
    (tmp_path / "way").write_bytes(b"")
    monkeypatch.setattr(cache, "places", lambda: (tmp_path / "way" / "in", workshop.kept))
    workshop.write(user=KERNEL)
    workshop.run("user").twice(1.0)
    assert len(workshop.entries()) == 1
    assert len(workshop.files()) == 2


def test_a_kernel_that_does_not_compile_lets_the_next_process_try(workshop):
    workshop.write(user=KERNEL.replace("2.0 * x", "no_such_name * x"))
    for _ in range(2):
        with pytest.raises(Exception, match="no_such_name"):
            workshop.run("user").twice(1.0)
    assert list(workshop.kept.glob("*")) == []


def test_who_waits_for_another_process_is_told(workshop):
    workshop.write(user=KERNEL)
    told = []

    def release(compiling):
        told.append((compiling.kernel, compiling.awaited, compiling.ended))
        if compiling.awaited:
            fcntl.flock(held, fcntl.LOCK_UN)

    workshop.run("user").twice(1.0)
    (entry,) = workshop.entries()
    for path in workshop.files():
        path.unlink()
    held = os.open(entry.with_suffix(".lock"), os.O_RDWR | os.O_CREAT)
    fcntl.flock(held, fcntl.LOCK_EX)
    with listening(release):
        assert workshop.run("user").twice(1.0) == 2.0
    os.close(held)
    assert told == [("user.twice", True, False), ("user.twice", False, False), ("user.twice", False, True)]


SCRIPT = """
import sys, time
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from surgsim.compiled import cache
from surgsim.compiling import listening
cache.places = lambda: (Path(sys.argv[1]) / "kept",)
with listening(lambda told: told.ended and print(told.kernel, flush=True)):
    import user
    print("ready", flush=True)
    sys.stdin.readline()
    assert user.twice(1.0) == 2.0
"""


def test_processes_compile_a_kernel_once_between_them(workshop, tmp_path):
    workshop.write(user=KERNEL)
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    pipe = subprocess.PIPE
    with (
        subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as one,
        subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as other,
    ):
        assert (one.stdout.readline(), other.stdout.readline()) == ("ready\n", "ready\n")
        one.stdin.write("\n")
        one.stdin.flush()
        said = [process.communicate("\n", timeout=120)[0] for process in (other, one)]
    assert (one.returncode, other.returncode) == (0, 0)
    assert sorted(said) == ["", "user.twice\n"]
