"""Measurements that need a process of their own."""

import json
import os
import subprocess
import sys
from typing import Any

from surgsim.errors import SurgsimError

_LONGEST_S = 1800.0


def in_child(function: str, *arguments: object) -> Any:
    """What `function`, `module:name`, of a fresh process answers, through JSON.

    Raises:
        SurgsimError: If the process fails.
    """
    module, name = function.split(":")
    given = json.dumps(json.dumps(arguments))
    call = f"import json; from {module} import {name} as f; print(json.dumps(f(*json.loads({given}))))"
    done = subprocess.run(
        [sys.executable, "-c", call],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        timeout=_LONGEST_S,
        check=False,
    )
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or ["it said nothing"]
        raise SurgsimError(f"bench: the process of {name} ended with {done.returncode}: {last[0]}")
    return json.loads(done.stdout.splitlines()[-1])
