"""Tasks: the desired motion of the instrument's tip."""

from surgsim.catalog import Catalog

TASKS = Catalog(
    "task",
    "surgsim.tasks",
    {
        "circle": "surgsim.tasks.circle:CircleConfig",
        "sinusoid": "surgsim.tasks.sinusoid:SinusoidConfig",
        "spiral": "surgsim.tasks.spiral:SpiralConfig",
    },
)
