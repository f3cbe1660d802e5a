"""Draws `recording.png`: the circle in the viewer. Needs Vulkan; a software one such as lavapipe will do."""

import io
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

from surgsim.recording.write import write_recording
from surgsim.runs.folder import execute
from surgsim.scenario.load import load_scenario

SIZE = (1600, 950)
TITLE_BAR = 36  # rows of pixels that speak of the machine, not of the recording
AT_S = 6.0
VIEWER = (sys.executable, "-P", "-c", "import sys; from rerun_cli.__main__ import main; sys.exit(main())")
START_TIMEOUT_S = 60.0
LOADING_S = 10.0  # the viewer does not say when all is drawn


def main() -> int:
    """Write the picture beside this file."""
    result = execute(load_scenario("circle_lwr4plus", controller="vprnn"))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "recording.rrd"
        write_recording(file, result.trace, result.metrics)
        try:
            pixels = photograph(file)
        except (ConnectionError, RuntimeError) as error:
            print(f"the viewer does not run here; it needs Vulkan: {error}", file=sys.stderr)
            return 1
    path = Path(__file__).with_name("recording.png")
    picture = Image.open(io.BytesIO(pixels)).convert("RGB").crop((0, TITLE_BAR, *SIZE))
    picture.save(path, optimize=True)
    print(path)
    return 0


def photograph(file: Path) -> bytes:
    """A PNG of the viewer, without a window, on a recording.

    Raises:
        RuntimeError: If the viewer does not answer, or draws nothing.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    size = "x".join(map(str, SIZE))
    options = ("--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", size)
    silent = subprocess.DEVNULL
    viewer = subprocess.Popen([*VIEWER, str(file), *options], stdout=silent, stderr=silent)
    try:
        client = opened(f"rerun+http://127.0.0.1:{port}/proxy", viewer)
        time.sleep(LOADING_S)
        return client.take_screenshot()
    finally:
        viewer.terminate()
        viewer.wait()


def opened(address: str, viewer: subprocess.Popen[bytes]) -> ViewerClient:
    """The viewer, once it has opened the recording, its time where the picture is taken."""
    until = time.monotonic() + START_TIMEOUT_S
    while viewer.poll() is None:
        try:
            client = ViewerClient(address)
            client.set_time("sim_time", duration=AT_S, play_state="paused")
            return client
        except (ConnectionError, RuntimeError, ValueError):
            if time.monotonic() > until:
                raise
            time.sleep(0.5)
    raise RuntimeError(f"it ended with status {viewer.returncode}")


if __name__ == "__main__":
    sys.exit(main())
