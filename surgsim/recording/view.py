"""Showing a recording: in rerun's native viewer, or in a browser on this machine."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

from surgsim.errors import SurgsimError
from surgsim.recording.framing import check_framing, recording_file

_HOST = "127.0.0.1"
# As the `rerun` script: `-m rerun_cli` loses the exit status, `-m rerun` imports the whole SDK.
_RERUN = (sys.executable, "-P", "-c", "import sys; from rerun_cli.__main__ import main; sys.exit(main())")
_START_TIMEOUT_S = 60.0


def display() -> str:
    """Where windows open; empty where there is no such place, which shows on Linux alone."""
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or ""
    return named if sys.platform == "linux" else named or "screen"


def view(path: Path) -> None:
    """Open the native viewer on a recording or a run's folder, until its window is closed.

    Raises:
        RecordingError: If there is no whole recording.
        SurgsimError: If the viewer cannot be opened.
    """
    file = _checked(path)
    if not display():
        raise SurgsimError("the viewer needs a display, and this session has none; --web serves a browser")
    command = [*_RERUN, str(file), "--port", "auto", "--bind", _HOST]
    try:
        done = subprocess.run(command, stderr=subprocess.PIPE, check=False)
    except KeyboardInterrupt:
        return
    if done.returncode != 0:
        raise SurgsimError(f"the viewer ended with an error: {_last_line(done.stderr)}")


def serve(path: Path, port: int = 9090) -> None:
    """Serve the web viewer with a recording on 127.0.0.1 alone, until interrupted. Prints the address.

    Args:
        path: A recording or a run's folder.
        port: For the browser; 0 picks a free one.

    Raises:
        RecordingError: If there is no whole recording.
        SurgsimError: If the port is taken or the server does not start.
    """
    file = _checked(path)
    web_port, data_port = _free_port(port), _free_port(0)
    source = quote(f"rerun+http://{_HOST}:{data_port}/proxy", safe="")
    ports = ("--web-viewer-port", str(web_port), "--port", str(data_port))
    command = [*_RERUN, str(file), "--serve-web", "--bind", _HOST, *ports]
    with contextlib.suppress(KeyboardInterrupt), _running(command) as server:
        _await_port(server, web_port)
        print(f"http://{_HOST}:{web_port}/?url={source}", flush=True)
        print("serving until Ctrl-C", file=sys.stderr, flush=True)
        raise SurgsimError(f"the web viewer ended by itself with status {server.wait()}")


def _checked(path: Path) -> Path:
    file = recording_file(path)
    check_framing(file)
    return file.resolve()  # no path is then taken for an option or an address


def _free_port(port: int) -> int:
    """`port`, or a free one for 0; raises if it is taken."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_HOST, port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise SurgsimError(f"port {port} on {_HOST} cannot be used: {reason}") from error
        return int(probe.getsockname()[1])


def _await_port(server: subprocess.Popen[bytes], port: int) -> None:
    """Wait until the server answers.

    Raises:
        SurgsimError: If it ends, or does not answer in time.
    """
    until = time.monotonic() + _START_TIMEOUT_S
    while server.poll() is None and time.monotonic() < until:
        with socket.socket() as probe:
            probe.settimeout(1.0)
            if probe.connect_ex((_HOST, port)) == 0:
                return
        time.sleep(0.1)
    raise SurgsimError(f"the web viewer did not start on {_HOST}:{port}")


@contextlib.contextmanager
def _running(command: Sequence[str]) -> Iterator[subprocess.Popen[bytes]]:
    """A program and its children, ended on the way out, also when this process is asked to terminate."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    silent = subprocess.DEVNULL
    server = subprocess.Popen(command, stdout=silent, stderr=silent, start_new_session=True)
    try:
        yield server
    finally:
        signal.signal(signal.SIGTERM, before)
        if sys.platform == "win32":
            server.terminate()
        else:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(server.pid, signal.SIGTERM)
        server.wait()


def _last_line(output: bytes) -> str:
    lines = [line.strip() for line in output.decode(errors="replace").splitlines() if line.strip()]
    return lines[-1] if lines else "no reason given"
