"""An external controller joined to a kernel: its numbers for the kernel, its failures in words, its end."""

from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.control.external import exchange
from surgsim.control.external.command import Function, read_command
from surgsim.control.external.declared import remember
from surgsim.control.external.exchange import CLOSED, OWN_MEMORY, POST_SIZE, Post
from surgsim.control.external.given_commands import command_for
from surgsim.control.external.greeting import greeting
from surgsim.control.external.layout import JOINT_VELOCITY, REQUEST, reply, request, runs
from surgsim.control.external.library import Library
from surgsim.control.external.process import Process
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen, layout
from surgsim.tick.overlay import laid_over

_POLLIN, _POLLOUT, _SHOWN = 1, 4, 16


class Outside:
    """An external controller that was started and has declared itself.

    Args:
        name: What the scenario calls it; its command is the one that is given for that name.
        arm: The nominal arm, which it is told of.
        gives: What it is to answer: `JOINT_VELOCITY` or `JOINT_TORQUE`.
        timeout_s: How long an answer may take [s].
        start_timeout_s: How long its declaration may take [s].

    Raises:
        SurgsimError: If there is no command, or it cannot be started or declares nothing that fits.

    Attributes:
        gains: Numbers for a kernel that calls `exchange`.
        declared: What it says of itself.
        has_state: Whether it remembers something that is not in the kernel's memory.
    """

    def __init__(
        self, name: str, arm: ArmModel, gives: int, *, timeout_s: float, start_timeout_s: float
    ) -> None:
        text = command_for(name)
        self._who, self._unit = f"external controller '{name}'", "rad/s" if gives == JOINT_VELOCITY else "N m"
        command, n = read_command(name, text), arm.limits.q_min.size
        head, told = greeting(arm, gives)
        self._process: Process | None = None
        self._library: Library | None = None
        self._request, self._reply = np.zeros(1, request().dtype), np.zeros(reply().dtype.itemsize // 8 + 1)
        self._plan = np.array(runs(n), dtype=np.int64).ravel()
        self._files, self._report = np.full(4, -1), np.zeros(2, dtype=np.int64)
        self._request["magic"], self._request["n"] = REQUEST, n
        self.gains = np.zeros(POST_SIZE)
        self._post: Any = laid_over(Post, self.gains)
        self._fill_post(n, timeout_s)
        if isinstance(command, Function):
            self._library = Library(self._who, command.file, command.name)
            self.declared = self._library.greet(head, told)
            self._post.function = self._library.address
        else:
            self._process = Process(self._who, command.words)
            self.declared = self._process.greet(head + told, start_timeout_s)
            ask, answer = self._process.files
            self._files[:] = answer | _POLLIN << 32, ask, answer, ask | _POLLOUT << 32
        remember(text, self.declared)

    def _fill_post(self, n: int, timeout_s: float) -> None:
        """All but who is asked."""
        post, fields = self._post, layout(Seen, n).fields
        assert fields is not None
        post.timeout_s, post.q_word = timeout_s, fields["q"][1] // 8
        post.request, post.request_bytes = self._request.ctypes.data, self._request.dtype.itemsize
        post.reply, post.reply_bytes = self._reply.ctypes.data, reply().dtype.itemsize
        post.plan, post.runs = self._plan.ctypes.data, self._plan.size // 3
        post.files, post.report = self._files.ctypes.data, self._report.ctypes.data

    @property
    def memory_size(self) -> int:
        """Length of the kernel's memory."""
        return OWN_MEMORY + self.declared.memory

    @property
    def has_state(self) -> bool:
        """Whether it remembers something that is not in the kernel's memory: a process may."""
        return self._process is not None

    def reason(self, seen: Seen) -> str:
        """Why there was no answer, for the person who reads the outcome; a process is ended."""
        why, more = (int(word) for word in self._report)
        at, process = f"at {float(seen.t_s):.3f} s", self._process
        if why == CLOSED and process is not None:
            part = f" after {more} of {self._post.reply_bytes} bytes of an answer" if more else ""
            text = f"{process.ended()}{part} {at}"
        else:
            text = self._deed(why, more, at)
        self.kill()
        return f"{self._who} {text}{process.last_words if process else ''}"

    def _deed(self, why: int, more: int, at: str) -> str:
        """What it did, where it did not end by itself; `more` as in its report."""
        match why:
            case exchange.SILENT:
                return f"did not answer within {float(self._post.timeout_s):g} s {at}{self._what_came(more)}"
            case exchange.UNREAD:
                return f"did not read what it was asked within {float(self._post.timeout_s):g} s {at}"
            case exchange.INTERRUPTED:
                return f"did not answer within {exchange.AFTER_SIGNAL_S:g} s of a signal {at}"
            case exchange.TOO_LONG:
                return f"answered with more than {self._post.reply_bytes} bytes {at}"
            case exchange.FOREIGN:
                return f"gave what is no answer {at}{self._what_came(more)}"
            case exchange.LATE:
                return f"answered the request {self._words[1]}, not {self._request['tick'][0]}, {at}"
            case exchange.STATUS:
                return f"gave the status {more} {at}: 0 is an answer, 1 says that there is no command"
            case exchange.NOT_FINITE:
                return f"gave {float(self._answer[more])} {self._unit} for joint {more + 1} {at}"
        return f"gave no answer {at}"

    @property
    def _words(self) -> NDArray[np.int64]:
        return self._reply.view(np.int64)

    @property
    def _answer(self) -> Array:
        return self._reply[3:]

    def _what_came(self, count: int) -> str:
        """The beginning of what came in place of an answer."""
        if count == 0:
            return ""
        beginning = self._reply.tobytes()[: min(count, _SHOWN)]
        return f": {count} of {self._post.reply_bytes} bytes came, beginning with {beginning!r}"

    def kill(self) -> None:
        """End a process at once."""
        self._files[:] = -1  # a later tick must not write into a file that has its number by then
        if self._process is not None:
            self._process.kill()

    def close(self) -> None:
        """End a process in order; there is no answer afterwards."""
        self._files[:] = -1
        if self._process is not None:
            self._process.close()

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"what {self._who} remembers is in a process of its own, or goes by its addresses")
