"""What an arm has and its controller's model does not."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Level:
    """A payload and friction, neither known to the controller.

    Attributes:
        payload_kg: Mass fixed to the tip adapter [kg].
        coulomb_nm: Dry friction of every joint [N m].
    """

    payload_kg: float = 0.0
    coulomb_nm: float = 0.0

    def __str__(self) -> str:
        """In words."""
        both = f"payload {self.payload_kg:g} kg, friction {self.coulomb_nm:g} N m"
        return "nominal" if self == NOMINAL else both

    @property
    def disturbances(self) -> str:
        """The scenario's `disturbances` as YAML."""
        payload = [f"{{type: payload, mass_kg: {self.payload_kg}}}"] if self.payload_kg else []
        friction = [f"{{type: joint_friction, coulomb_nm: {self.coulomb_nm}}}"] if self.coulomb_nm else []
        return f"disturbances=[{', '.join(payload + friction)}]"


NOMINAL = Level()
