"""Tasks: the desired motion of the instrument's tip."""

from surgsim.catalog import Catalog

TASKS = Catalog(
    "task",
    "surgsim.tasks",
    {
        "circle": "surgsim.tasks.circle:CircleConfig",
        "depth": "surgsim.tasks.depth:DepthConfig",
        "insertion": "surgsim.tasks.insertion:InsertionConfig",
        "sinusoid": "surgsim.tasks.sinusoid:SinusoidConfig",
        "spiral": "surgsim.tasks.spiral:SpiralConfig",
        "teleoperation": "surgsim.tasks.teleoperation:TeleoperationConfig",
    },
)
