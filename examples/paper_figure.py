"""A figure for a paper: the RCM error of three controllers over a payload that nobody told them of.

    python examples/paper_figure.py rcm_error.pdf

It is a column wide and holds its letters; the same runs give the same bytes. Errors over time and box plots
of a batch need no script: `surgsim export RUN --figure FILE.pdf`.
"""

import sys
from pathlib import Path

import surgsim
from surgsim.export.paper_style import colours, figure_bytes, journal_style, new_figure, strokes

out = Path(sys.argv[1] if len(sys.argv) > 1 else "rcm_error.pdf")
controllers = ["pinv", "joint_impedance", "rcm_inverse_dynamics"]
masses_kg = [0.05, 0.1, 0.2, 0.4]
with journal_style():
    figure = new_figure("column", height_in=2.2)
    axes = figure.subplots()
    for controller, colour, stroke in zip(controllers, colours(3), strokes(3), strict=True):
        errors_mm = []
        for mass_kg in masses_kg:
            payload = [{"type": "payload", "mass_kg": mass_kg}]
            run = surgsim.run(
                "circle_lwr4plus", controller=controller, task={"duration_s": 3.0}, disturbances=payload
            )
            errors_mm.append(run.metrics["rcm_error_rms_mm"])
        axes.loglog(masses_kg, errors_mm, stroke, color=colour, marker="o", markersize=3, label=controller)
    axes.set_xlabel("payload [kg]")
    axes.set_ylabel("RCM error, RMS [mm]")
    axes.set_xticks(masses_kg, [f"{mass:g}" for mass in masses_kg])
    axes.minorticks_off()
    axes.legend(frameon=False)
    out.write_bytes(figure_bytes(figure, out))
print(f"wrote {out}")
