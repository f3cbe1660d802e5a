"""The program of a second process that compiles the kernels of every run (`surgsim.simulate.ahead`).

It reads the number of joints, and ends when all is compiled or the process that asked for it has ended.
"""

import os
import sys
import threading
from typing import Any

import numba
import numpy as np
from numba import types

from surgsim.compiled import as_parameter, compile_for
from surgsim.control.decision import decide, decide_signature
from surgsim.control.manifold import Manifold, climb, climb_from, is_inside, project
from surgsim.control.manipulability import manipulability
from surgsim.simulate.derived import derive, derive_signature
from surgsim.simulate.ticks import (
    ask_signature,
    ask_task,
    hold_signature,
    hold_ticks,
    run_signature,
    run_ticks,
)
from surgsim.tick.arrays import A1, A2, Model, type_of


def compile_kernels(joints: int) -> None:
    """Compile each kernel that no part changes, for an arm of so many joints."""
    model, number = type_of(Model, joints), types.float64
    place, q = np.zeros(3), np.zeros(joints)
    typed: Any = numba.typeof
    on = typed(Manifold(rows=0, p_WT=place, p_WC=place, low=q, high=q))
    as_parameter(run_ticks, run_signature(joints))
    as_parameter(decide, decide_signature(joints))
    compile_for(project, model, on, A1, types.int64)
    compile_for(manipulability, A2)
    compile_for(climb, model, on, A1, types.int64, number)
    compile_for(is_inside, on, A1, number)
    compile_for(climb_from, model, on, A1, number, A1, A1)
    as_parameter(derive, derive_signature(joints))
    as_parameter(hold_ticks, hold_signature(joints))
    as_parameter(ask_task, ask_signature(joints))


def _end_with_parent() -> None:
    """End this process when the other one has: its end of the pipe is then closed."""
    sys.stdin.buffer.read()
    os._exit(0)


def main() -> None:
    """Wait for the number of joints; compile everything, or until the process that asked for it ends."""
    joints = sys.stdin.buffer.readline()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if joints:
        compile_kernels(int(joints))
    os._exit(0)  # Python's own end would wait for the thread that reads


if __name__ == "__main__":
    main()
