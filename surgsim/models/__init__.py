"""MuJoCo models: the compiled scene, and the controller's own model of the arm."""
