import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.parse import parse_qs, urlparse

import pytest

from surgsim.errors import RecordingError, SurgsimError
from surgsim.recording.view import serve, view


def listening(port: int) -> set[str]:
    """Local addresses, as the kernel writes them, on which someone listens at `port`."""
    found = set()
    for table in (Path("/proc/net/tcp"), Path("/proc/net/tcp6")):
        for line in table.read_text().splitlines()[1:] if table.exists() else []:
            _, local, _, state, *_ = line.split()
            address, at = local.split(":")
            if state == "0A" and int(at, 16) == port:
                found.add(address)
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_the_web_viewer_listens_on_this_machine_only_and_ends_when_told(recording: Path) -> None:
    code = "import sys, pathlib, surgsim.recording.view as v; v.serve(pathlib.Path(sys.argv[1]), 0)"
    server = subprocess.Popen([sys.executable, "-c", code, str(recording)], stdout=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        url = urlparse(server.stdout.readline().strip())
        source = urlparse(parse_qs(url.query)["url"][0])
        ports = [url.port, source.port]
        assert url.hostname == source.hostname == "127.0.0.1"
        assert [listening(port) for port in ports] == [{"0100007F"}, {"0100007F"}]
        server.send_signal(signal.SIGTERM)
        assert server.wait(timeout=20) == 0
        assert [listening(port) for port in ports] == [set(), set()]
    finally:
        server.kill()
        server.wait()
        server.stdout.close()


def test_a_port_in_use(recording: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(
            SurgsimError, match=f"port {port} on 127.0.0.1 cannot be used: Address already in use"
        ):
            serve(recording, port)


def test_what_is_no_recording_is_not_shown(tmp_path: Path) -> None:
    (tmp_path / "text.rrd").write_text("hello")
    for show in (view, serve):
        with pytest.raises(RecordingError, match="is not a rerun recording"):
            show(tmp_path / "text.rrd")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have a display")
def test_no_display(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delitem(os.environ, name, raising=False)
    with pytest.raises(SurgsimError, match="needs a display"):
        view(recording)
    monkeypatch.setenv("DISPLAY", ":991")
    with pytest.raises(SurgsimError, match=r"the viewer ended with an error: .*X server"):
        view(recording)
