"""Scenarios that a person, an editor or a disk has spoilt; each file's last line says the error."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from surgsim.cli.main import main

FILES = sorted((Path(__file__).parent / "scenarios").glob("*.yaml"))
MARK = "# refused: "
GOOD = Path(__file__).with_name("good.yaml").read_text()

BYTES = {
    "empty": (b"", "the file is empty"),
    "blanks": (b"\n  \n\n", "the file is empty"),
    "utf 16": (GOOD.encode("utf-16"), "is not UTF-8 text: byte 0xff at offset 0"),
    "utf 16 without mark": (GOOD.encode("utf-16-le"), "has a control or invalid character: '\\x00'"),
    "utf 32": (GOOD.encode("utf-32"), "is not UTF-8 text"),
    "latin 1": (f"description: gr\xf6\xdfer\n{GOOD}".encode("latin-1"), "is not UTF-8 text: byte 0xf6"),
    "nul": (GOOD.replace("made", "ma\0de").encode(), "has a control or invalid character: '\\x00'"),
    "escape": (GOOD.replace("made", "ma\x1b[31mde").encode(), "has a control or invalid character: '\\x1b'"),
    "second mark": (f"\ufeff\ufeff{GOOD}".encode(), "has a control or invalid character"),
    "zeros": (bytes(4096), "has a control or invalid character: '\\x00'"),
    "png": (b"\x89PNG\r\n\x1a\n" + bytes(100), "is not UTF-8 text: byte 0x89 at offset 0"),
    "gzip": (b"\x1f\x8b\x08\x00" + bytes(range(200)), "is not UTF-8 text"),
    "elf": (b"\x7fELF\x02\x01\x01" + bytes(9), "has a control or invalid character"),
    "huge": (GOOD.encode() + b"# " + b"x" * 300_000, "is larger than 256 KiB"),
    "many keys": (b"".join(b"k%d: 1\n" % i for i in range(9000)), "name: missing."),
    "one long line": (b"name: " + b"a" * 200_000, "robot: missing."),
    "half": (GOOD.encode()[:60], "is not valid YAML"),
    "cut in a number": (GOOD.encode()[: GOOD.index("0.55, 0.02]") + 2], "is not valid YAML"),
    "cut in a character": (GOOD.encode() + "description: ö".encode()[:-1], "is not UTF-8 text: byte 0xc3"),
    "twice": (GOOD.encode() * 2, "duplicate key"),
    "old line ends in a key": (GOOD.replace("task:", "task\r:").encode(), "is not valid YAML"),
}


def test_the_good_one_is_good(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("good.yaml").write_text(GOOD, encoding="utf-8")
    assert main(["check", "good.yaml", "--quiet"]) == 0
    assert len(FILES) >= 100


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_handmade(path: Path, refused) -> None:
    text = path.read_text(encoding="utf-8")
    said = text.splitlines()[-1]
    assert said.startswith(MARK)
    line = refused("check", path)
    assert said.removeprefix(MARK) in line
    assert path.name in line or "nothing.yaml" in line or "/dev/zero" in line


@pytest.mark.parametrize("name", BYTES)
def test_spoilt_bytes(name: str, refused, tmp_path) -> None:
    content, reason = BYTES[name]
    (tmp_path / "made.yaml").write_bytes(content)
    line = refused("check", "made.yaml")
    assert line.startswith("made.yaml")
    assert reason in line


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _loop(path: Path) -> None:
    path.symlink_to(path.name)


def _dangling(path: Path) -> None:
    path.symlink_to("nowhere.yaml")


def _zeros(path: Path) -> None:
    path.symlink_to("/dev/zero")


PLACES = {
    "folder": (Path.mkdir, "is a folder or a device"),
    "pipe": (_pipe, "is a folder or a device"),
    "loop of links": (_loop, "cannot be read: Too many levels of symbolic links"),
    "link to nothing": (_dangling, "cannot be read: No such file or directory"),
    "link to a device": (_zeros, "is a folder or a device"),
    "nothing": (lambda path: None, "cannot be read: No such file or directory"),
}


@pytest.mark.parametrize("command", ["check", "run", "compare"])
@pytest.mark.parametrize("name", PLACES)
def test_what_is_no_file(name: str, command: str, refused, tmp_path) -> None:
    make, reason = PLACES[name]
    make(tmp_path / "made.yaml")
    assert refused(command, "made.yaml").startswith(f"made.yaml: {reason}")


@contextmanager
def nobody() -> Iterator[None]:
    """Root may read everything: within the block it is nobody, and reaches the working folder alone."""
    before = os.geteuid()
    if before == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(before)


def test_no_permission(refused, tmp_path) -> None:
    path = tmp_path / "made.yaml"
    path.write_text(GOOD)
    tmp_path.chmod(0o755)
    assert main(["check", "--quiet", "made.yaml"]) == 0, "what checking imports is imported as who we are"
    path.chmod(0)
    with nobody():
        assert refused("check", "made.yaml") == "made.yaml: cannot be read: Permission denied"


@pytest.mark.parametrize(
    "name", ["", ".", "/", "..", "a\nb", "a\x1b[31m", "ä", "x" * 5000, "vprnn", "quick "]
)
def test_names_that_are_no_scenario(name: str, refused) -> None:
    line = refused("check", name)
    assert "is not a shipped scenario. Known: " in line
    assert line.endswith("Or give a .yaml file.")


@pytest.mark.parametrize(
    "name", ["a\nb.yaml", "\0.yaml", "x" * 5000 + ".yaml", "a/b/c.yaml", "/etc/passwd/x.yaml"]
)
def test_paths_that_are_no_scenario(name: str, refused) -> None:
    assert "cannot be read: " in refused("check", name)


def test_every_file_of_several_is_named(monkeypatch, tmp_path, capfd) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        Path(f"{name}.yaml").write_text(GOOD.replace("0.2]", "9.0]"), encoding="utf-8")
    assert main(["check", "a.yaml", "b.yaml"]) == 2
    lines = capfd.readouterr().err.splitlines()
    assert [line.split(" ")[1] for line in lines] == ["a.yaml:", "b.yaml:"]
