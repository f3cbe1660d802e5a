"""The steps of the image's build, without an image: installed, warmed, run as anybody, read-only, offline."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import laboratory as lab
import pytest

ROOT = Path(__file__).resolve().parents[1]
STEPS = ROOT / "examples" / "container"
PACKAGES = Path(pytest.__file__).resolve().parents[1]
NOBODY = "23456"
KERNELS = "__pycache__/kernels"


def call(*words, cwd, **variables):
    done = subprocess.run(
        [str(word) for word in words],
        cwd=cwd,
        env={
            "PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin",
            "PYTHONPATH": str(PACKAGES),
            **variables,
        },
        capture_output=True,
        text=True,
        timeout=400,
    )
    assert done.returncode == 0, f"{words}: {done.stdout}\n{done.stderr}"
    return done


@pytest.fixture(scope="module")
def image():
    """What the image would hold: an installation, warmed, that nobody may write to.

    It has its packages from the tests' interpreter, and kernels from the checkout; warming adds the others.
    """
    folder = Path(tempfile.mkdtemp(prefix="surgsim-image-"))
    folder.chmod(0o755)  # which a user of any number enters
    try:
        offline = ("--quiet", "--no-index", "--no-build-isolation", "--no-deps")
        call("sh", STEPS / "install.sh", ROOT, folder / "surgsim", *offline, cwd=folder)
        (place,) = (folder / "surgsim" / "lib").glob("python*/site-packages/surgsim")
        shutil.copytree(ROOT / "surgsim" / KERNELS, place / KERNELS, dirs_exist_ok=True)
        protocol = lab.short_protocol(folder)
        call("sh", STEPS / "warm.sh", folder / "surgsim", protocol.path, "pinv", cwd=folder, HOME=str(folder))
        yield folder
    finally:
        subprocess.run(["chmod", "-R", "u+w", str(folder)], check=False)
        shutil.rmtree(folder)


def files_of(folder):
    return {path: path.stat().st_mtime_ns for path in (folder / "surgsim").rglob("*")}


@pytest.mark.needs("namespace")
def test_a_score_runs_as_any_user_without_home_network_or_anything_to_write_to_but_its_folder(image):
    out = image / "out"
    out.mkdir()
    alone = ["unshare", "--net"]
    if os.getuid() == 0:
        os.chown(out, int(NOBODY), int(NOBODY))
        alone += ["setpriv", "--reuid", NOBODY, "--regid", NOBODY, "--clear-groups"]
        read = "+dac_read_search"  # the tests' interpreter may lie in the home of root; nothing to write with
        alone += ["--inh-caps", read, "--ambient-caps", read]
    else:
        alone.insert(1, "--map-root-user")
    before = files_of(image)
    words = ("score", "pinv", "--protocol", image / "short.yaml", "--arms", "panda", "--jobs", "1")
    where = ("--store", "store", "--out", "score")
    done = call(*alone, image / "surgsim" / "bin" / "surgsim", *words, *where, cwd=out, TMPDIR=str(out))
    told = json.loads((out / "score" / "score.json").read_text(encoding="utf-8"))
    assert (told["arms"], told["scorecard"]["runs"]) == (["panda"], 7)
    assert "compiling" not in done.stderr
    assert files_of(image) == before
    assert not [path for path in before if path.stat().st_mode & 0o222 and not path.is_symlink()]
    assert {path.name for path in out.iterdir()} >= {"score", "store"}


def test_the_build_is_these_steps():
    """The image is made by the scripts that are tested here, from files that there are."""
    text = (STEPS / "Containerfile").read_text(encoding="utf-8")
    assert "RUN sh /source/install.sh /source /opt/surgsim" in text
    assert "RUN sh /source/warm.sh /opt/surgsim surgsim_v1" in text
    copied = [line.split()[1:-1] for line in text.splitlines() if line.startswith("COPY ")]
    names = [name for line in copied for name in line]
    assert {"surgsim", "assets", "scenarios", "examples/container/warm.sh"} <= set(names)
    assert all((ROOT / name).exists() for name in names)
