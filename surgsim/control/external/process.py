"""A controller in a process of its own: how it is started, what is heard of it, and how it ends.

It reads requests from its standard input and writes replies to its standard output; what it writes to
standard error is kept for the message of a failure. It is the first of a session of its own, so that Ctrl-C
in a terminal does not reach it before surgsim has ended it, and so that whatever it started ends with it.
"""

import contextlib
import os
import select
import signal
import subprocess
import threading
import time
import weakref
from collections import deque
from collections.abc import Sequence

from surgsim.control.external.declared import Declared, read_declaration
from surgsim.control.external.layout import declaration
from surgsim.errors import SurgsimError

_LAST_WORDS = 400
_KEPT = 8
_CHUNK = 4096
_GRACE_S = 1.0
_PAUSE_S = 0.002


class Process:
    """A running external controller.

    Args:
        who: What messages call it.
        words: The program and its arguments.

    Raises:
        SurgsimError: If it cannot be started.
    """

    def __init__(self, who: str, words: Sequence[str]) -> None:
        self._who = who
        try:
            self._popen = subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            told = getattr(error, "strerror", None) or str(error)
            raise SurgsimError(f"{who} cannot be started: {words[0]}: {told}") from error
        self._chunks: deque[bytes] = deque(maxlen=_KEPT)
        self._hearing = threading.Thread(target=_hear, args=(self._popen, self._chunks), daemon=True)
        self._hearing.start()
        self._end = weakref.finalize(self, _end, self._popen, self._hearing, _GRACE_S)

    @property
    def files(self) -> tuple[int, int]:
        """The files that requests are written to and replies are read from."""
        assert self._popen.stdin is not None
        assert self._popen.stdout is not None
        return self._popen.stdin.fileno(), self._popen.stdout.fileno()

    def greet(self, content: bytes, timeout_s: float) -> Declared:
        """Send the hello, and read what it declares.

        Raises:
            SurgsimError: If it ends, says nothing in time, or what it says is no declaration.
        """
        try:
            return read_declaration(self._exchange(content, timeout_s), self._who)
        except BaseException:
            self.kill()
            raise

    def _exchange(self, content: bytes, timeout_s: float) -> bytes:
        """Write all of `content`, and read a declaration meanwhile: a text may be more than a pipe holds."""
        ask, answer = self.files
        until, size, got = time.monotonic() + timeout_s, declaration().dtype.itemsize, b""
        os.set_blocking(ask, False)
        while content or len(got) < size:
            readable, writable = _ready(answer if len(got) < size else None, ask if content else None, until)
            if writable:
                try:
                    content = content[os.write(ask, content) :]
                except BrokenPipeError:
                    content, readable = (
                        b"",
                        True,
                    )  # it has ended: what it said before is read, and then its end
            elif not readable:
                raise SurgsimError(f"{self._who} {_not_said(len(got), size, timeout_s)}{self.last_words}")
            if readable:
                more = os.read(answer, size - len(got)) if len(got) < size else b""
                if not more:
                    text = f"{self._who} {self.ended()} before it declared itself"
                    raise SurgsimError(f"{text}{self.last_words}")
                got += more
        return got  # requests are not waited for either: one that does not read must not stop the run

    def ended(self) -> str:
        """How it ended; it is given a moment for that. It is killed if it is still there."""
        if not _has_ended(self._popen, 0.1):
            self.kill()
            return "closed its standard output"
        self.kill()
        code = self._popen.returncode
        if code < 0:
            return f"was ended by {_signal_name(-code)}"
        return f"ended with status {code}"

    @property
    def last_words(self) -> str:
        """The end of what it wrote to standard error, to be put behind a sentence; or nothing."""
        self._hearing.join(0.05)
        text = " ".join(b"".join(tuple(self._chunks)).decode(errors="replace").split())
        shown = text if len(text) <= _LAST_WORDS else f"...{text[-_LAST_WORDS:]}"
        return f"; its last words: {shown}" if shown else ""

    def kill(self) -> None:
        """End it at once."""
        if self._end.detach() is not None:
            _end(self._popen, self._hearing, 0.0)

    def close(self) -> None:
        """End it in order: its standard input ends, it has a second, and is killed if that is not enough."""
        self._end()


def _ready(answer: int | None, ask: int | None, until: float) -> tuple[bool, bool]:
    """Whether an answer can be read, and whether can be asked, as soon as either can; neither: time is up."""
    watch = select.poll()
    if answer is not None:
        watch.register(answer, select.POLLIN)
    if ask is not None:
        watch.register(ask, select.POLLOUT)
    ready = dict(watch.poll(max(0.0, 1e3 * (until - time.monotonic()))))
    return answer in ready, ask in ready


def _not_said(got: int, size: int, timeout_s: float) -> str:
    """What of a declaration is missing when time is up."""
    if got == size:
        return f"did not read the description of the arm within {timeout_s:g} s"
    whole = f"{got} of {size} bytes of a declaration" if got else "nothing"
    return f"did not declare itself within {timeout_s:g} s: it said {whole}"


def _hear(popen: "subprocess.Popen[bytes]", chunks: deque[bytes]) -> None:
    """Keep the end of what it writes to standard error."""
    assert popen.stderr is not None
    with popen.stderr as file, contextlib.suppress(OSError):
        while chunk := os.read(file.fileno(), _CHUNK):
            chunks.append(chunk)


def _end(popen: "subprocess.Popen[bytes]", hearing: threading.Thread, grace_s: float) -> None:
    """End a process and whatever it started, and leave neither a zombie nor an open file."""
    for file in (popen.stdin, popen.stdout):
        assert file is not None
        with contextlib.suppress(OSError):
            file.close()
    try:
        _has_ended(popen, grace_s)
    finally:
        with contextlib.suppress(OSError):
            os.killpg(popen.pid, signal.SIGKILL)  # before it is reaped: the number is still its own
        popen.wait()
        hearing.join(_GRACE_S)


def _has_ended(popen: "subprocess.Popen[bytes]", within_s: float) -> bool:
    """Whether a child ends within a time; it is not reaped, where the system can tell without that."""
    until = time.monotonic() + within_s
    while True:
        if not hasattr(os, "waitid"):
            ended = popen.poll() is not None
        elif popen.returncode is not None:
            ended = True
        else:
            ended = os.waitid(os.P_PID, popen.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
        if ended or time.monotonic() >= until:
            return ended
        time.sleep(_PAUSE_S)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
