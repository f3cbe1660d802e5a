"""A controller in a process of its own, in Python alone so that it starts at once; it fails as it is told.

As velocities it gives what the resolver `pinv` gives, in the same order of operations, so to the same bit; as
torques it makes the joints follow their reference. The first argument is how it fails, the second at which
request of a run, counted from 1, the third a seed, the fourth its version. `gives_up` is no failure of the
process: it says once that there is no command. One that is `deaf` goes on answering, and reads no more.
"""

import json
import math
import os
import struct
import sys
import time

LAYOUT = os.path.join(os.path.dirname(__file__), "../../examples/external/python/layout.json")
FAILURES = (
    "killed",
    "ends",
    "closes",
    "hangs",
    "stutters",
    "garbage",
    "short",
    "long",
    "late",
    "nan",
    "status",
)
NAME, RELEASE = "a controller of the tests", "3.1"


def command(*words):
    """What starts it."""
    import shlex  # which the process itself needs not wait for

    return shlex.join([sys.executable, "-S", "-E", __file__, *map(str, words)])


def pinv(seen):
    """q' = J^T (J J^T)^-1 v, as `surgsim.tick.algebra.nearest`; None where J has lost rank."""
    n, rows, k = seen["n"], seen["rows"], 5.0
    J = [seen["Jv_WT"][8 * i : 8 * i + n] for i in range(3)]
    J += [seen["J_rcm"][8 * i : 8 * i + n] for i in range(rows)]
    v = [seen["v_WTd"][i] - k * (seen["p_WT"][i] - seen["p_WTd"][i]) for i in range(3)]
    v += [seen["rcm_velocity"][i] - k * seen["rcm_error"][i] for i in range(rows)]
    m = len(J)
    A = [[0.0] * m for _ in range(m)]
    for i in range(m):
        for j in range(m):
            for x, y in zip(J[i], J[j], strict=True):
                A[i][j] += x * y
    for j in range(m):
        s = A[j][j]
        for i in range(j):
            s -= A[j][i] * A[j][i]
        if not s > 1e-14 * A[j][j]:
            return None
        A[j][j] = math.sqrt(s)
        for i in range(j + 1, m):
            s = A[i][j]
            for h in range(j):
                s -= A[i][h] * A[j][h]
            A[i][j] = s / A[j][j]
    for i in range(m):
        for h in range(i):
            v[i] -= A[i][h] * v[h]
        v[i] /= A[i][i]
    for i in range(m - 1, -1, -1):
        for h in range(i + 1, m):
            v[i] -= A[h][i] * v[h]
        v[i] /= A[i][i]
    answer = []
    for j in range(n):
        s = 0.0
        for i in range(m):
            s += J[i][j] * v[i]
        answer.append(s)
    return answer


def following(seen):
    """tau = M (w^2 (q_ref - q) + 2 w (q_ref' - q')) + D q_ref'."""
    n, w = seen["n"], 60.0
    wanted = [
        w * w * (seen["q_ref"][j] - seen["q"][j]) + 2.0 * w * (seen["qdot_ref"][j] - seen["v"][j])
        for j in range(n)
    ]
    return [
        sum(seen["M"][8 * i + j] * wanted[j] for j in range(n)) + seen["damping"][i] * seen["qdot_ref"][i]
        for i in range(n)
    ]


def serve(fails, at, seed, release):
    """Answer until the run is over."""
    with open(LAYOUT, encoding="utf-8") as file:
        layout = json.load(file)
    messages = layout["messages"]
    hello = struct.unpack("<8q", os.read(0, messages["hello"]["bytes"]))
    text = b""
    while len(text) < hello[7]:
        text += os.read(0, hello[7] - len(text))
    assert len(json.loads(text)["joints"]) == hello[5]
    told = (messages["declaration"]["magic"], layout["version"], layout["hash"], 0)
    os.write(1, struct.pack("<4q64s64s", *told, NAME.encode(), release.encode()))
    answer = pinv if hello[6] == layout["gives"]["joint_velocity"] else following
    size = messages["request"]["bytes"]
    while len(content := os.read(0, size)) == size:
        seen = unpacked(content, messages["request"]["fields"])
        if fails in FAILURES and seen["tick"] == at:
            fail(fails, seen, messages["reply"], seed)
        found = None if fails == "gives_up" and seen["tick"] == at else answer(seen)
        os.write(1, packed(messages["reply"], seen["tick"], found))
        while fails == "deaf" and seen["tick"] >= at:  # it answers what it does not read
            seen["tick"] += 1
            time.sleep(0.005)  # two answers at once would be seen as too long a one
            os.write(1, packed(messages["reply"], seen["tick"], found))


def unpacked(content, fields):
    """The fields of a request by name: numbers, and arrays as flat lists."""
    seen = {}
    for field in fields:
        count = math.prod(field["shape"])
        values = struct.unpack_from(
            f"<{count}{'q' if field['type'] == 'i8' else 'd'}", content, field["offset"]
        )
        seen[field["name"]] = list(values) if field["shape"] else values[0]
    return seen


def packed(reply, tick, answer, status=0):
    """A reply; one that there is no command where the answer is None."""
    values = [*(answer or []), *[0.0] * 8][:8]
    return struct.pack("<3q8d", reply["magic"], tick, 1 if answer is None else status, *values)


def fail(how, seen, reply, seed):
    """Fail once in this way; afterwards there is nothing to be heard."""
    import random
    import signal

    draws = random.Random(seed)
    right = packed(reply, seen["tick"], [0.1] * seen["n"])
    if how == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "ends":
        print("the watchdog bit", file=sys.stderr, flush=True)
        os._exit(3)
    if how == "closes":
        os.close(1)
    if how == "stutters":
        os.write(1, right[:24])
    if how == "garbage":
        os.write(1, draws.randbytes(len(right)))
    if how == "short":
        os.write(1, draws.randbytes(draws.randrange(1, len(right))))
    if how == "long":
        os.write(1, right + b"more")
    if how == "late":
        os.write(1, packed(reply, seen["tick"] - 1, [0.1] * seen["n"]))
    if how == "nan":
        os.write(1, packed(reply, seen["tick"], [0.1, math.nan]))
    if how == "status":
        os.write(1, packed(reply, seen["tick"], [0.1], status=7))
    time.sleep(3600.0)


if __name__ == "__main__":
    given = dict(enumerate(sys.argv[1:]))
    serve(given.get(0, ""), int(given.get(1, 0)), int(given.get(2, 0)), given.get(3, RELEASE))
