"""MuJoCo models: the compiled scene, and the controller's own model of the arm."""

from surgsim.models.warnings import keep_off_the_disk

keep_off_the_disk()
