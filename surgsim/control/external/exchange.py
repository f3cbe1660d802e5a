"""The exchange of a tick with an external controller, as a kernel: no Python is entered.

The request is filled from what a part sees, word by word, and given to the controller: a function by its
address, a process through a pipe. A process that does not answer, or answers what is no answer, leaves a
reason in the `Post`'s report, whose words are in `surgsim.control.external.outside`.
"""

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.external.calls import call_c, monotonic, sys_poll, sys_read, sys_write
from surgsim.control.external.layout import REPLY
from surgsim.tick.arrays import Record, Seen
from surgsim.tick.overlay import overlay
from surgsim.tick.status import EXTERNAL, GOES_ON, INFEASIBLE
from surgsim.tick.views import vector, words

FINE, SILENT, CLOSED, TOO_LONG, FOREIGN, LATE, STATUS, NOT_FINITE, INTERRUPTED, UNREAD = range(10)
"""Why there is no answer: the first word of a report."""
TICK, FIRST = 1, 3
"""Words of a request."""
_HEAD, _READY = 3, 1
_TO_WRITE = 3
_BROKEN = 8 | 16 | 32
"""POLLERR, POLLHUP and POLLNVAL: nobody reads there."""
AFTER_SIGNAL_S = 0.1
"""How long an answer may still take after a signal: Ctrl-C is Python's, which is not entered before [s]."""


class Post(Record):
    """Beginning of the gains of a kernel that asks an external controller.

    Attributes:
        function: Address of its function; 0 for a process.
        timeout_s: How long an answer may take [s].
        request: Address of the request.
        request_bytes: Its size.
        reply: Address of the room for a reply, which is a word longer than that.
        reply_bytes: Size of a reply.
        plan: Address of `layout.runs`, three words each.
        runs: How many there are.
        q_word: Where `Seen.q` is in what is seen, in words.
        files: Address of the numbers of a process's files: the `pollfd` of the one that it writes to, the
            one that it reads from, the one that it writes to, and the `pollfd` of the one that it reads
            from. They are -1 once it is ended.
        report: Address of two words: the reason, and one that says more.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(
        ("function", "request", "reply", "plan", "files", "report")
    )
    function: int
    timeout_s: float
    request: int
    request_bytes: int
    reply: int
    reply_bytes: int
    plan: int
    runs: int
    q_word: int
    files: int
    report: int


POST, POST_SIZE = overlay(Post)
OWN_MEMORY = 1
"""Entries of a kernel's memory before those of a function: the number of the last request."""


@compiled
def exchange(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Have the controller's answer in `out` (n,); `memory` begins with the number of the last request.

    Returns:
        GOES_ON; INFEASIBLE where the controller says so; EXTERNAL where there is no answer.
    """
    post = gains[:POST_SIZE].view(POST)[0]
    report = words(post.report, 2)
    memory[0] += 1.0
    _fill(post, seen, int(memory[0]))
    if post.function != 0:
        status = call_c(post.function, post.request, memory[OWN_MEMORY:].ctypes.data, post.reply + 8 * _HEAD)
    else:
        why = _ask(post, report)
        if why != FINE:
            report[0] = why
            return EXTERNAL
        status = words(post.reply, _HEAD)[2]
    if status == INFEASIBLE:
        return INFEASIBLE
    if status != GOES_ON:
        report[0], report[1] = STATUS, status
        return EXTERNAL
    answer = vector(post.reply + 8 * _HEAD, out.size)
    for j in range(out.size):
        if not math.isfinite(answer[j]):
            report[0], report[1] = NOT_FINITE, j
            return EXTERNAL
        out[j] = answer[j]
    return GOES_ON


@compiled
def _fill(post: Post, seen: Seen, tick: int) -> None:
    """The request of this tick."""
    start = seen.q.ctypes.data - 8 * post.q_word
    plan, target = words(post.plan, 3 * post.runs), words(post.request, post.request_bytes // 8)
    target[TICK] = tick
    for k in range(post.runs):
        at, to, count = plan[3 * k], plan[3 * k + 1], plan[3 * k + 2]
        source = words(start + 8 * at, count)
        for i in range(count):
            target[to + i] = source[i]


@compiled
def _ask(post: Post, report: NDArray[np.int64]) -> int:
    """Send the request, wait for the reply; FINE, or why there is none."""
    report[1] = 0
    files, until = words(post.files, _TO_WRITE + 1), monotonic() + post.timeout_s
    sent = sys_write(files[1], post.request, post.request_bytes)
    if sent != post.request_bytes:  # what it has not read yet fills the pipe, or it has ended
        why = _send_rest(post, files, max(sent, 0), until)
        if why != FINE:
            return why
    wait_s, got, silent = post.timeout_s, 0, SILENT
    while got < post.reply_bytes:
        ready = sys_poll(post.files, 1, math.ceil(1e3 * wait_s))
        if ready == _READY:
            count = sys_read(files[2], post.reply + got, post.reply_bytes + 8 - got)
            if count <= 0:
                return CLOSED
            got += count
            report[1] = got
        elif ready < 0 and silent == SILENT:
            until, silent = min(until, monotonic() + AFTER_SIGNAL_S), INTERRUPTED
        if got < post.reply_bytes:
            wait_s = until - monotonic()
            if wait_s <= 0.0:
                return silent
    head = words(post.reply, _HEAD)
    if head[0] != REPLY:
        return FOREIGN
    if got > post.reply_bytes:
        return TOO_LONG
    return FINE if head[1] == words(post.request, TICK + 1)[TICK] else LATE


@compiled
def _send_rest(post: Post, files: NDArray[np.int64], sent: int, until: float) -> int:
    """Send what is left of a request as soon as it is read; FINE, or why it is not."""
    why, refused = UNREAD, False
    while sent < post.request_bytes:
        wait_s = until - monotonic()
        if wait_s <= 0.0:
            return why
        ready = sys_poll(post.files + 8 * _TO_WRITE, 1, math.ceil(1e3 * wait_s))
        if ready < 0:
            if why == UNREAD:
                until, why = min(until, monotonic() + AFTER_SIGNAL_S), INTERRUPTED
            continue
        if ready == _READY:
            if refused or (files[_TO_WRITE] >> 48) & _BROKEN:
                return CLOSED
            count = sys_write(files[1], post.request + sent, post.request_bytes - sent)
            refused = count <= 0
            sent += max(count, 0)
    return FINE
