"""The parts of one arm in a compiled model, by the names that they have in the arm's own file.

Where several arms share a model, each one's parts have its name and a slash before their own.
"""

from dataclasses import dataclass
from typing import Any

import mujoco


def prefix_of(arm: str) -> str:
    """What stands before the names of an arm's parts in a model that several share."""
    return f"{arm}/"


@dataclass(frozen=True)
class Named:
    """A compiled model, its parts found by an arm's own names.

    Attributes:
        model: The model.
        prefix: What stands before the arm's names in it; empty where there is one arm.
    """

    model: mujoco.MjModel
    prefix: str = ""

    def body(self, name: str) -> Any:
        """A body of the arm, as MuJoCo gives it."""
        return self.model.body(self.prefix + name)

    def joint(self, name: str) -> Any:
        """A joint of the arm."""
        return self.model.joint(self.prefix + name)

    def site(self, name: str) -> Any:
        """A site of the arm."""
        return self.model.site(self.prefix + name)

    def actuator(self, name: str) -> Any:
        """A motor of the arm."""
        return self.model.actuator(self.prefix + name)

    def numeric(self, name: str) -> Any:
        """A numeric of the arm."""
        return self.model.numeric(self.prefix + name)

    def find(self, kind: mujoco.mjtObj, name: str) -> int:
        """The id of a part of the arm, -1 if there is none of that name."""
        return int(mujoco.mj_name2id(self.model, kind, self.prefix + name))

    def has_camera(self, name: str) -> bool:
        """Whether the arm has a camera of that name."""
        return self.find(mujoco.mjtObj.mjOBJ_CAMERA, name) >= 0

    def text(self, name: str) -> str | None:
        """A text of the arm; None if there is none of that name."""
        index = self.find(mujoco.mjtObj.mjOBJ_TEXT, name)
        if index < 0:
            return None
        first, size = int(self.model.text_adr[index]), int(self.model.text_size[index])
        content: Any = self.model.text_data
        whole = content if isinstance(content, bytes | str) else bytes(content)
        part = whole[first : first + size]
        return (part if isinstance(part, str) else part.decode()).strip("\0 ")

    def joints(self) -> dict[int, str]:
        """The joints of the arm and of what belongs to it, by their ids, with their own names."""
        every = {i: str(self.model.joint(i).name) for i in range(self.model.njnt)}
        return {
            i: name.removeprefix(self.prefix) for i, name in every.items() if name.startswith(self.prefix)
        }
