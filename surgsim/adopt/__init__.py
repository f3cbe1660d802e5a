"""Making a robot's folder of somebody's model file: the arm, its card, and where it can work."""
