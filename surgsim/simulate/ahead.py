"""A second process that compiles the kernels of every run, while the first compiles those of its parts.

Where nothing is compiled yet a run waits for kernels for most of a minute. Half of them are the same whatever
the parts are: the loop of the ticks, the decision, the derived columns, the climb in manipulability. They are
compiled by `surgsim.simulate.kernels_of_every_run`. Of processes that need the same kernel one compiles it
(`surgsim.compiled.lock`), so that nothing is done twice.
"""

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from surgsim.resources import cores, module_program

_PROGRAM = "surgsim.simulate.kernels_of_every_run"


@contextmanager
def compiling_ahead() -> Iterator[Callable[[int], None]]:
    """A second process, which ends with the block; there is none on one processor.

    It gets ready at once, and compiles what every run needs from when what is yielded takes the number of
    joints.
    """
    silent, helper = subprocess.DEVNULL, None
    if cores() > 1:
        with suppress(OSError):  # then this process compiles everything
            command, environment = module_program(_PROGRAM)
            helper = subprocess.Popen(
                command, env=environment, stdin=subprocess.PIPE, stdout=silent, stderr=silent
            )

    def compile_for_joints(joints: int) -> None:
        if helper is not None and helper.stdin is not None:
            with suppress(OSError):  # it has ended
                helper.stdin.write(f"{joints}\n".encode())
                helper.stdin.flush()

    try:
        yield compile_for_joints
    finally:
        if helper is not None:
            helper.kill()
            helper.communicate()
