"""The resolver of the page on adding one: its two forms run as they are printed, and agree."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from surgsim.contract.arms import arm_of, scenes
from surgsim.contract.problems import velocity_problem
from surgsim.contract.resolvers import steps
from surgsim.control.resolvers.base import KernelResolver

PAGE = Path(__file__).parents[3] / "docs" / "add_a_controller.md"


def printed(folder, word):
    """The first Python block of the page that has the word, run from a file."""
    block = next(b for b in re.findall(r"^```py\n(.*?)^```$", PAGE.read_text(), re.M | re.S) if word in b)
    (folder / "documented.py").write_text(block)
    return runpy.run_path(str(folder / "documented.py"))


@pytest.mark.parametrize("trocar", [True, False])
def test_the_class_and_the_kernel_that_are_printed_agree(trocar, tmp_path):
    arm = arm_of(next(scene for scene in scenes() if arm_of(scene).limits.q_min.size == 7))
    config = printed(tmp_path, "class JointCenteringConfig")["JointCenteringConfig"]()
    kernel = printed(tmp_path, "def joint_centering")
    by_class, by_kernel = config.build(arm), kernel["build"](config, arm)
    assert isinstance(by_kernel, KernelResolver)
    for seed in range(5):
        problem = velocity_problem(arm, seed, trocar=trocar)
        (expected,), _ = steps(by_class, [problem])
        (found,), _ = steps(by_kernel, [problem])
        np.testing.assert_allclose(found.qdot, expected.qdot, rtol=0.0, atol=1e-12)
        assert found.residual == pytest.approx(expected.residual, abs=1e-12)
