"""A picture of where an arm can work."""

import io

import numpy as np

from surgsim.adopt.ports import DEPTH_M, RADIUS_M, PortMap


def port_picture(ports: PortMap, name: str) -> bytes:
    """The map of ports as a PNG: distance and height of the port, and the room that is left there."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 5.2), layout="constrained")
    axes = figure.add_subplot()
    margin = np.rad2deg(ports.margin_rad)
    if ports.reached:
        shown = axes.pcolormesh(ports.x_m, ports.z_m, margin, cmap="viridis", vmin=0.0)
        figure.colorbar(shown, label="smallest distance of a joint from its limit [deg]")
    row, column = np.where(~np.isfinite(margin))
    axes.plot(ports.x_m[column], ports.z_m[row], "x", color="#9a3b3b", label="cannot be used")
    if (best := ports.best_m) is not None:
        axes.plot(*best, "o", mfc="none", mec="white", mew=2.5, ms=14)
        axes.plot(*best, "o", mfc="none", mec="black", mew=1.0, ms=14, label="most room")
    axes.plot(0.0, 0.0, "s", color="black", ms=9, label="base")
    axes.set_xlim(-0.1, float(ports.x_m[-1] + 0.1))
    axes.set_xlabel("port in front of the base [m]")
    axes.set_ylabel("port above the base [m]")
    axes.set_aspect("equal")
    axes.set_title(
        f"{name}: upright ports through which a circle of {1e3 * RADIUS_M:.0f} mm,\n"
        f"{1e3 * DEPTH_M:.0f} mm below, can be followed",
        fontsize=11,
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, fontsize=9, frameon=False)
    written = io.BytesIO()
    FigureCanvasAgg(figure).print_png(written, metadata={"Software": None})
    return written.getvalue()
