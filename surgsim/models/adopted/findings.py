"""All that was found in an arm's file."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.chain import Chain, find_chain
from surgsim.models.adopted.config import ArmFileConfig
from surgsim.models.adopted.file import ModelFile, read_file
from surgsim.models.adopted.limits import Limits, find_limits
from surgsim.models.adopted.links import Link, Links, rigid_links
from surgsim.models.adopted.problem import AdoptionError


@dataclass(frozen=True, kw_only=True, eq=False)
class Findings:
    """All that was found in an arm's file.

    Attributes:
        file: The file.
        chain: Where the arm is in it.
        limits: What the joints can do.
        links: What moves as one.
        armature: Inertia of each motor as its joint feels it (n,) [kg m²].
    """

    file: ModelFile
    chain: Chain
    limits: Limits
    links: Links
    armature: Array

    @property
    def model(self) -> mujoco.MjModel:
        """The file's model, compiled as it stands."""
        return self.file.model

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.chain.joints)

    @cached_property
    def parts(self) -> dict[str, Link]:
        """`base`, `link1` and so on, from the base on."""
        names = ("base", *(f"link{i + 1}" for i in range(self.n)))
        return dict(zip(names, (self.links.base, *self.links.links), strict=True))

    @property
    def last(self) -> Link:
        """The link that carries the flange."""
        return self.links.links[-1]


def read_arm(robot: ArmFileConfig) -> Findings:
    """What the file that `robot` names holds.

    Raises:
        AdoptionError: If the file or the keys of `robot` make no arm.
    """
    file = read_file(*robot.file)
    chain = find_chain(file.model, robot)
    limits = find_limits(file, chain, robot)
    return Findings(
        file=file,
        chain=chain,
        limits=limits,
        links=rigid_links(file.model, chain),
        armature=_armature(file.model, chain, robot.armature_kg_m2),
    )


def _armature(model: mujoco.MjModel, chain: Chain, given: tuple[float, ...] | None) -> Array:
    """What the scenario gives, else what the file has."""
    dofs = [int(model.jnt_dofadr[j]) for j in chain.joints]
    if given is None:
        return np.array(model.dof_armature[dofs], dtype=float)
    if len(given) != len(dofs):
        reason = f"armature_kg_m2 has {len(given)} numbers; the arm has {len(dofs)} joints"
        raise AdoptionError(reason, "armature_kg_m2")
    return np.array(given, dtype=float)
