"""How the RCM error grows with the payload that nobody told the controllers of, in ten lines.

python examples/parameter_sweep.py
"""

import surgsim

controllers = ["pinv", "joint_impedance", "rcm_inverse_dynamics"]
print("payload [kg]  " + "  ".join(controllers))
for mass_kg in (0.0, 0.1, 0.2, 0.4):
    errors = []
    for controller in controllers:
        payload = [{"type": "payload", "mass_kg": mass_kg}] if mass_kg else []
        run = surgsim.run(
            "circle_lwr4plus", controller=controller, task={"duration_s": 4.0}, disturbances=payload
        )
        errors.append(f"{run.metrics['rcm_error_rms_mm']:{len(controller)}.3g}")
    print(f"{mass_kg:12g}  " + "  ".join(errors))
