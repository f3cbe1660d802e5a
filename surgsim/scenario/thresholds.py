"""What a run is held against once it is over: figures of merit with a source, not limits that stop it."""

from typing import Annotated, Self

from pydantic import Field

from surgsim.catalog import PartConfig

_CHOICE = "docs/safety.md"


class Threshold(PartConfig):
    """The largest value of a metric that passes.

    Attributes:
        most: Largest value, in the metric's unit.
        source: Where the figure comes from.
    """

    most: Annotated[float, Field(ge=0.0)]
    source: Annotated[str, Field(min_length=1, max_length=120)] = "the scenario"

    @classmethod
    def chosen(cls, most: float) -> Self:
        """A threshold of the project's own choice, whose reasons docs/safety.md gives."""
        return cls(most=most, source=_CHOICE)


class ThresholdsConfig(PartConfig):
    """Thresholds of a run, each named after the metric that it is about; null leaves one out.

    They stop nothing: what ends a run are the limits of `safety`.

    Attributes:
        tip_error_end_mm: Distance of the tip from its command at the end; of tasks that are a path [mm].
        tip_error_max_mm: Largest distance of the tip from its command; of tasks that are a path [mm].
        rcm_error_max_mm: Largest distance of the trocar from the shaft's axis [mm].
        trocar_force_max_n: Largest force of the shaft on the abdominal wall [N].
    """

    tip_error_end_mm: Threshold | None = Threshold.chosen(1.0)
    tip_error_max_mm: Threshold | None = Threshold.chosen(3.0)
    rcm_error_max_mm: Threshold | None = Threshold.chosen(5.0)
    trocar_force_max_n: Threshold | None = Threshold.chosen(5.0)
