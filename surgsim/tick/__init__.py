"""What a tick of the control loop carries, and the kernels that every part of it may use."""
