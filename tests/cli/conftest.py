"""A terminal as a person has one: commands run in it with a width, and keys can be pressed."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from dataclasses import dataclass, field
from typing import Any

import pytest

# A session of its own with the terminal as its controlling one, so that Ctrl-C reaches the command. No
# signal is ignored, as it is in what runs in the background or under nohup.
_TAKE_TERMINAL = """
import fcntl, os, signal, sys, termios
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""
_ESCAPE = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b[@-_]")


@dataclass
class Typed:
    """A command that runs, or has run, in a terminal.

    Attributes:
        process: It, a `subprocess.Popen` or as much of one as we use.
        screen: Our end of its terminal.
        output: What it has written so far, with every escape sequence.
    """

    process: Any
    screen: int
    output: bytearray = field(default_factory=bytearray)

    def wait(self, timeout_s=200.0, until=None):
        """Read what it writes, until it ends, or until `until()`, which it must not end before."""
        end = time.monotonic() + timeout_s
        while not (until and until()):
            assert time.monotonic() < end, f"it does not end:\n{self.text}"
            if not select.select([self.screen], [], [], 0.02)[0]:
                continue
            try:
                piece = os.read(self.screen, 65536)
            except OSError:  # the other end is closed: it has ended
                piece = b""
            if not piece:
                self.process.wait(timeout=60)
                break
            self.output += piece
        assert until is None or until(), f"it has ended before:\n{self.text}"
        return self

    def press(self, keys):
        os.write(self.screen, keys)

    @property
    def status(self):
        return self.process.returncode

    @property
    def text(self):
        """What it wrote, without colours and cursor movements."""
        return _ESCAPE.sub("", self.output.decode().replace("\r\n", "\n"))

    @property
    def lines(self):
        """Every line that was on the screen at some time: those that were drawn over as well."""
        return [line.rstrip() for line in re.split(r"[\n\r]+", self.text) if line.strip()]


def _cold(words, terminal, folder, environment):
    """A process that starts in a terminal."""
    return subprocess.Popen(
        [sys.executable, "-c", _TAKE_TERMINAL, *words],
        cwd=folder,
        env=environment,
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        start_new_session=True,
    )


@pytest.fixture
def typing(tmp_path):
    """Opens a terminal of some columns, and has a process begun in it, in a folder."""
    started = []

    def start(begin, words, columns=80, cwd=tmp_path, env=None):
        ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
        unwanted = ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR")
        environment = {key: value for key, value in os.environ.items() if key not in unwanted}
        process = begin(words, theirs, cwd, {**environment, "TERM": "xterm-256color", **(env or {})})
        os.close(theirs)
        started.append(Typed(process, ours))
        return started[-1]

    yield start
    for typed in started:
        if typed.process.poll() is None:
            os.killpg(typed.process.pid, signal.SIGKILL)
            typed.process.wait()
        os.close(typed.screen)


@pytest.fixture
def terminal(typing):
    """Starts a command in a terminal."""

    def start(*words, **options):
        return typing(_cold, words, **options)

    return start


@pytest.fixture
def surgsim(terminal, typing, warm):
    """Starts `surgsim` in a terminal: as a fork of a warm process, or `cold`, as a person does."""

    def start(*words, cold=False, strict=True, **options):
        def begin(words, screen, folder, environment):
            return warm.start(words, [screen] * 3, folder, environment, terminal=True, strict=strict)

        if cold:
            errors = ("-W", "error") if strict else ()
            return terminal(sys.executable, *errors, "-m", "surgsim", *words, **options)
        return typing(begin, words, **options)

    return start
