"""Commands in poor surroundings: a locale that is not UTF-8, no home, a folder that must stay clean."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from batches import short_run

ROOT = Path(__file__).resolve().parents[2]
SHORT = tuple(f"--set={setting}" for setting in short_run(0.3))


def surgsim(*words, cwd, strict=True, **variables):
    """The finished command, in English and with the present folder of kernels."""
    options = ("-X", "warn_default_encoding", "-W", "error::EncodingWarning:surgsim") if strict else ()
    command = [sys.executable, *options, "-m", "surgsim", *map(str, words)]
    env = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, timeout=240)


@pytest.mark.parametrize("encoding", ["latin-1", "ascii"])
def test_files_are_utf8_and_a_terminal_shows_what_it_can(tmp_path, encoding):
    text = (ROOT / "scenarios" / "circle_lwr4plus.yaml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines(keepends=True) if not line.startswith("description:")]
    (tmp_path / "a.yaml").write_text(
        "".join(['description: "Größe 5 µm → Trokar"\n', *lines]), encoding="utf-8"
    )
    poor = {"PYTHONIOENCODING": encoding, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = surgsim("run", "a.yaml", *SHORT, "--no-record", "--out", "out", cwd=tmp_path, **poor)
    assert done.returncode in (0, 1), done.stderr.decode(encoding)
    resolved = (tmp_path / "out" / "scenario.yaml").read_text(encoding="utf-8")
    assert "Größe 5 µm → Trokar" in resolved
    done = surgsim("check", "out/scenario.yaml", cwd=tmp_path, **poor)
    assert done.returncode == 0, done.stderr.decode(encoding)
    shown = {"latin-1": "Größe 5 µm ? Trokar", "ascii": "Gr??e 5 ?m ? Trokar"}[encoding]
    assert shown in done.stdout.decode(encoding)


def test_a_run_without_a_home_writes_its_folder_and_nothing_else(tmp_path):
    work, home, scratch = (tmp_path / name for name in ("work", "home", "scratch"))
    for folder in (work, home, scratch):
        folder.mkdir()
    surroundings = {
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / "cache"),
        "XDG_CONFIG_HOME": str(home / "config"),
        "TMPDIR": str(scratch),
    }
    words = ("run", "circle_lwr4plus", *SHORT, "--set=instrument.mass_kg=1000", "--out", "out")
    done = surgsim(*words, cwd=work, strict=False, **surroundings)
    assert done.returncode in (0, 1), done.stderr.decode()
    assert {path.name for path in work.iterdir()} == {"out"}
    kernels = [path for path in tmp_path.rglob("*.nbi")]
    others = [
        path for path in (*home.rglob("*"), *scratch.rglob("*")) if path.is_file() and path not in kernels
    ]
    assert others == []
