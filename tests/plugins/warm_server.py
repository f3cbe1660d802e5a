"""A process that has imported the whole of surgsim, and forks itself for every command that it is asked for.

`warm` starts it. It reads requests from the socket whose number it is given, and ends when the other end is
closed. Each command has a process of its own, whose parent tells the test how it ended.
"""

import gc
import importlib
import json
import os
import pkgutil
import signal
import socket
import sys
import warnings
from contextlib import suppress
from typing import Any

_ON_THEIR_OWN = ("surgsim.__main__", "surgsim.live", "surgsim.bench", "surgsim.compare.ray_engine")
_SHORT = ("task.duration_s=0.3", "task.ramp_s=0.1", "task.hold_start_s=0", "task.hold_end_s=0")


def warm_up() -> None:
    """Import what commands import, and load the kernels of a run."""
    import surgsim

    for found in pkgutil.walk_packages(surgsim.__path__, "surgsim."):
        if not found.name.startswith(_ON_THEIR_OWN):
            importlib.import_module(found.name)

    from surgsim.metrics.catalog import compute_metrics
    from surgsim.scenario.load import load_scenario
    from surgsim.simulate.loop import simulate

    compute_metrics(simulate(load_scenario("circle_lwr4plus", assignments=[*_SHORT, "task.radius_m=0.002"])))
    gc.collect()
    gc.freeze()  # what all commands share is neither looked through by them nor taken down


def serve(requests: socket.socket) -> list[str]:
    """Fork for every request; return in each command's own process, with its words."""
    while True:
        content, descriptors, *_ = socket.recv_fds(requests, 1 << 20, 4)
        if not content:
            os._exit(0)
        with suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        if os.fork() == 0:
            requests.close()
            *streams, status = descriptors
            _watch(status)
            return _become(json.loads(content), streams)
        for descriptor in descriptors:
            os.close(descriptor)


def _watch(status: int) -> None:
    """Fork once more; return in the command's process, and tell `status` its number and how it ended."""
    child = os.fork()
    if child == 0:
        os.close(status)
        return
    os.closerange(0, status)
    os.write(status, f"{child}\n".encode())
    _, ended = os.waitpid(child, 0)
    os.write(status, f"{os.waitstatus_to_exitcode(ended)}\n".encode())
    os._exit(0)


def _become(asked: dict[str, Any], streams: list[int]) -> list[str]:
    """Be as a process that was started with these words, streams, folder and environment."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    if asked["terminal"]:
        import fcntl
        import termios

        os.setsid()
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)  # so that Ctrl-C reaches the command
    os.chdir(asked["folder"])
    sys.path[0] = asked["folder"]  # as `python -m` has it
    os.environ.clear()
    os.environ.update(asked["environment"])
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        mode, errors = (
            ("r", "strict") if number == 0 else ("w", "backslashreplace" if number == 2 else "strict")
        )
        lines = 1 if number == 2 or os.isatty(number) else -1
        stream = open(number, mode, lines, errors=errors, closefd=False)  # noqa: SIM115
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    if not asked["strict"]:
        sys.warnoptions.clear()
        warnings.simplefilter("ignore")
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # ignored where tests run under nohup
    words: list[str] = asked["words"]
    sys.argv[1:] = words
    return words


if __name__ == "__main__":
    warm_up()
    words = serve(socket.socket(fileno=int(sys.argv[1])))
    from surgsim.cli.main import main

    sys.exit(main(words))
