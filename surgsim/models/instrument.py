"""The instrument on the flange, and the two sites that say where its shaft and tip are."""

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.tool import tool_spec
from surgsim.models.config import InstrumentConfig
from surgsim.models.graft import asset, graft

_DRAWN_DIAMETER_M = 0.008  # the template's jaws are drawn for this shaft
_JAWS_M = 0.018  # of the shaft's length, for an 8 mm shaft


def attach_instrument(arm: mujoco.MjSpec, config: InstrumentConfig | None) -> None:
    """Put the instrument on site `flange` of `arm`, with sites `shaft_entry` and `tip`.

    Both sites have z along the shaft, towards the tip. `shaft_entry` is the end of the adapter. Without an
    instrument `tip` is the flange and `shaft_entry` the wrist centre (the origin of the last link).
    """
    if config is None:
        flange = arm.site("flange")
        flange.parent.add_site(name="shaft_entry", quat=flange.quat, group=4)
        flange.parent.add_site(name="tip", pos=flange.pos, quat=flange.quat, group=4)
    else:
        graft(arm, instrument_spec(config), site=_mount(arm, config))


def instrument_spec(config: InstrumentConfig) -> mujoco.MjSpec:
    """The instrument of a file, or the shipped template with the sizes and the inertia of `config`.

    Its origin is at the flange, or at the end of the holder.
    """
    if config.of_file:
        return tool_spec(config.tool)
    spec = asset(f"instruments/{config.type}.xml")
    _set_inertia(spec.body("instrument"), config)
    _set_sizes(spec, config)
    return spec


def _mount(arm: mujoco.MjSpec, config: InstrumentConfig) -> mujoco.MjsSite:
    """Where the instrument is fixed: the flange, or the end of a rigid holder on it."""
    flange, holder = arm.site("flange"), config.holder
    if holder is None:
        return flange
    turn, place = np.zeros(4), np.zeros(3)
    quaternion = np.array(holder.quaternion_wxyz)
    mujoco.mju_mulQuat(turn, flange.quat, quaternion / np.linalg.norm(quaternion))
    mujoco.mju_rotVecQuat(place, np.array(holder.position_m), flange.quat)
    return flange.parent.add_site(name="holder", pos=flange.pos + place, quat=turn, group=4)


def rod_masses(config: InstrumentConfig) -> tuple[float, float]:
    """Masses (adapter, shaft) [kg] of two uniform rods with the mass and centre of mass of `config`.

    m_a + m_s = m and m_a a/2 + m_s (a + s/2) = m c, with adapter length a, shaft length s, centre of mass c.
    """
    return two_rods(config.mass_kg, config.com_m, config.adapter_length_m, config.shaft_length_m)


def two_rods(mass: float, com: float, adapter: float, shaft: float) -> tuple[float, float]:
    """`rod_masses` of a mass [kg] with its centre at `com` [m], on an adapter and a shaft so long [m]."""
    low, high = adapter / 2, adapter + shaft / 2
    of_shaft = mass * (com - low) / (high - low)
    return mass - of_shaft, of_shaft


def rod_inertia(config: InstrumentConfig, adapter_radius_m: float) -> Array:
    """Principal inertia (3,) [kg m²] about the centre of mass of the two rods of `rod_masses`.

    A solid cylinder of mass m, length l, radius r at distance d from the centre of mass adds
    m (3 r² + l²)/12 + m d² across and m r²/2 along the shaft: physically consistent by construction.
    """
    a, s = config.adapter_length_m, config.shaft_length_m
    m = np.array(rod_masses(config))
    length = np.array([a, s])
    radius = np.array([adapter_radius_m, config.shaft_diameter_m / 2])
    offset = np.array([a / 2, a + s / 2]) - config.com_m
    across = float(np.sum(m * ((3 * radius**2 + length**2) / 12 + offset**2)))
    along = float(np.sum(m * radius**2 / 2))
    return np.array([across, across, along])


def _set_inertia(body: mujoco.MjsBody, config: InstrumentConfig) -> None:
    radius = float(next(geom for geom in body.geoms if geom.name == "adapter").size[0])
    body.mass = config.mass_kg
    body.ipos = [0.0, 0.0, config.com_m]
    body.inertia = rod_inertia(config, radius)


def _set_sizes(spec: mujoco.MjSpec, config: InstrumentConfig) -> None:
    a, s = config.adapter_length_m, config.shaft_length_m
    scale = config.shaft_diameter_m / _DRAWN_DIAMETER_M
    drawn = s - _JAWS_M * scale
    adapter, band, shaft = (spec.geom(name) for name in ("adapter", "adapter_band", "shaft"))
    adapter.pos, adapter.size = [0, 0, a / 2], [adapter.size[0], a / 2, 0]
    band.pos = [0, 0, 0.85 * a]
    band.size = [band.size[0], 0.075 * a, 0]
    shaft.pos, shaft.size = [0, 0, a + drawn / 2], [config.shaft_diameter_m / 2, drawn / 2, 0]
    spec.site("shaft_entry").pos = [0, 0, a]
    spec.site("tip").pos = spec.body("jaws").pos = [0, 0, a + s]
    for geom in spec.body("jaws").geoms:
        geom.pos, geom.size = geom.pos * scale, geom.size * scale
    jaw = spec.mesh("jaw")
    jaw.scale = jaw.scale * scale
