"""Serve a controller of surgsim from a Python process; needs numpy, not surgsim.

`layout.json`, beside this file, says what is exchanged: `surgsim external layout > layout.json` makes it
again.

    from surgsim_external import serve

    def start(arm, gives):  # arm: joints, limits, MJCF, URDF; gives: "joint_velocity" or "joint_torque"
        def answer(seen):   # seen: the fields of a request by name, arrays over the arm's own n joints
            return seen["v_WTd"] @ seen["Jv_WT"]
        return answer       # it gives (n,) numbers, or None where there is no command

    serve("my controller", "1.0", start)
"""

import json
import os
import struct
import sys
from pathlib import Path

import numpy as np

_LAYOUT = json.loads(Path(__file__).with_name("layout.json").read_text(encoding="utf-8"))
_MESSAGES = _LAYOUT["messages"]
_NO_COMMAND = 1


def serve(name, release, start):
    """Answer requests until the run is over; `start(arm, gives)` returns what answers them.

    A run that begins again, `seen["first"]` is 1, has it called again.
    """
    asked, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what is printed goes to standard error: standard output belongs to the answers
    hello = _words(_read(asked, _MESSAGES["hello"]["bytes"]), "hello")
    if hello["magic"] != _MESSAGES["hello"]["magic"]:
        sys.exit("this is a controller: give it to surgsim with --external NAME=COMMAND")
    arm = json.loads(_read(asked, hello["text_bytes"]))
    gives = {number: text for text, number in _LAYOUT["gives"].items()}[hello["gives"]]
    answer = start(arm, gives)
    told = (_MESSAGES["declaration"]["magic"], _LAYOUT["version"], _LAYOUT["hash"], 0)
    answers.write(struct.pack("<4q64s64s", *told, name.encode(), release.encode()))
    seen, request = _views(hello["n"])
    reply, begun = np.zeros(1, _dtype("reply")), False
    reply["magic"] = _MESSAGES["reply"]["magic"]
    while len(content := asked.read(request.itemsize)) == request.itemsize:
        request.view(np.uint8)[:] = np.frombuffer(content, np.uint8)
        if seen["first"][()] and begun:
            answer = start(arm, gives)
        begun = True
        wanted = answer(seen)
        reply["tick"], reply["status"] = request["tick"], 0 if wanted is not None else _NO_COMMAND
        if wanted is not None:
            reply["answer"][0, : hello["n"]] = wanted
        answers.write(reply.tobytes())


def _read(file, count):
    content = file.read(count)
    if len(content) < count:
        sys.exit(0)
    return content


def _words(content, message):
    """The whole numbers of a message without arrays, by name."""
    names = [field["name"] for field in _MESSAGES[message]["fields"]]
    return dict(zip(names, struct.unpack(f"<{len(names)}q", content), strict=True))


def _dtype(message):
    kinds = {"f8": "<f8", "i8": "<i8"}
    fields = _MESSAGES[message]["fields"]
    return np.dtype([(field["name"], kinds[field["type"]], tuple(field["shape"])) for field in fields])


def _views(n):
    """The fields of a request by name, cut to the arm's n joints, and the request that they are views of."""
    request, seen = np.zeros(1, _dtype("request")), {}
    for field in _MESSAGES["request"]["fields"]:
        sizes = [slice(n if size == "n" else int(size)) for size in field["for_n_joints"].split()]
        values = request[field["name"]]
        seen[field["name"]] = values[(0, *sizes)] if sizes else values.reshape(())
    return seen, request
