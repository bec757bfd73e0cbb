"""The moving air of a scenario: wind, gusts and turbulence of each vehicle."""

from __future__ import annotations

import math
from types import ModuleType

from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.schema import Plan, TurbulenceFields
from ftcc.link.timing import Timing
from ftcc.sim.disturbances import Disturbance, Gust
from ftcc.sim.plants import flies_model, name_of
from ftcc.sim.turning_air import NOT_TURNING, ROTATION, TurningAir
from ftcc.sim.wind import AIR, NO_TURBULENCE, DiscreteGust, Turbulence

__all__ = [
    "check_wind",
    "discrete_gusts",
    "gust",
    "low_altitude",
    "mean_wind",
    "turbulence",
    "turning_air",
    "wind_texts",
]

_FOOT = 0.3048


def check_wind(plan: Plan, plant: ModuleType, findings: Findings) -> None:
    """Refuse moving air if the plant has none, and gusts for UAVs that are no followers."""
    channels = [name for name, _ in plant.DISTURBANCES]
    for table, needed in (("wind", ("wind", "gust")), ("gusts", AIR), ("turbulence", AIR)):
        if getattr(plan, table) and not {*needed} <= {*channels}:
            findings.refuse(f"{table}: the plant flies in still air")
    turning = plan.turbulence is not None and plan.turbulence.turning
    if turning and plant.Disturbances._fields[-len(ROTATION) :] != ROTATION:
        why = "flies by JSBSim, which takes no rotation" if flies_model(plant) else "has no body rates"
        findings.refuse(f"turbulence.turning = true: plant {name_of(plant)} {why}; leave it out")
    named = [(f"gusts.{n}.uavs", gust.uavs) for n, gust in enumerate(plan.gusts)]
    named += [("turbulence.uavs", plan.turbulence.uavs)] if plan.turbulence is not None else []
    for where, uavs in named:
        for uav in {*(uavs or ())} - {*plan.uavs.followers}:
            followers = ", ".join(map(str, plan.uavs.followers))
            findings.refuse(f"{where}: UAV {uav} is not a follower; followers are {followers}")


def mean_wind(plan: Plan, channels: list[str]) -> tuple[Disturbance, ...]:
    """Return the mean wind of (9.33)."""
    if plan.wind is None or plan.wind.mean == 0.0 or "wind" not in channels:
        return ()
    return (Disturbance(0.0, float(channels.index("wind")), plan.wind.mean, 0.0),)


def gust(plan: Plan) -> Gust:
    """Return the gust of (9.33)."""
    if plan.wind is None:
        return Gust()
    return Gust(plan.wind.gust, round(plan.wind.gust_period * 1e6), plan.seed)


def discrete_gusts(plan: Plan, uav: int, V: float, findings: Findings) -> tuple[DiscreteGust, ...]:
    """Return the discrete gusts of UAV ``uav``, whose initial airspeed is ``V`` (m/s)."""
    found = []
    for n, fields in enumerate(plan.gusts):
        if fields.uavs is not None and uav not in fields.uavs:
            continue
        rise = fields.length / (fields.airspeed or V)
        until = math.inf if fields.until is None else fields.until
        if not fields.held:
            until = fields.at + rise
        if until < fields.at + rise:
            findings.refuse(
                f"gusts.{n}.until = {until:g}: it rises until {fields.at + rise:g} s and cannot fall before"
            )
        found.append(DiscreteGust(fields.at, rise, fields.along, fields.right, fields.up, until))
    return tuple(found)


def turbulence(plan: Plan, uav: int, V: float, span: float, timing: Timing) -> Turbulence:
    """Return the turbulence of UAV ``uav`` with that ``span`` (m), whose initial airspeed is ``V`` (m/s)."""
    fields = plan.turbulence
    if fields is None or (fields.uavs is not None and uav not in fields.uavs):
        return NO_TURBULENCE
    sigma, length = _sizes(fields)
    V = fields.airspeed or V
    u, v, w = (V / along for along in length)
    turning = turning_air(sigma[2], length[2], span, V) if fields.turning and span > 0.0 else NOT_TURNING
    return Turbulence(sigma, (u, v, w), timing.step_us, plan.seed, turning)


def _sizes(fields: TurbulenceFields) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    if fields.sigma is not None and fields.length is not None:
        return fields.sigma, fields.length
    assert fields.wind_20ft is not None
    assert fields.altitude is not None
    return low_altitude(fields.wind_20ft, fields.altitude)


def low_altitude(wind: float, altitude: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return standard deviations (m/s) and scale lengths (m) along, right, up, below 1000 ft.

    Source: MIL-F-8785C, 3.7.3.4, figs. 10, 11.

    Parameters
    ----------
    wind : float
        Wind speed at 20 ft above the ground, m/s.
    altitude : float
        Above the ground, m.
    """
    h = altitude / _FOOT
    slope = 0.177 + 0.000823 * h
    up, level = 0.1 * wind, 0.1 * wind / slope**0.4
    length = h / slope**1.2 * _FOOT
    return (level, level, up), (length, length, altitude)


def turning_air(deviation: float, length: float, span: float, V: float) -> TurningAir:
    """Return how the air turns, for standard deviation (m/s) and scale length (m) of the gusts upwards.

    Source: MIL-F-8785C, 3.7.5: the square of sigma is the integral of the spectrum of p_g, see `ftcc.sim.turning_air`.

    Parameters
    ----------
    deviation, length : float
        sigma_w, m/s, and L_w, m.
    span : float
        Of the aircraft, m.
    V : float
        Airspeed, m/s.
    """
    wide = 4.0 * span / math.pi
    variance = deviation**2 / length * 0.8 * (length / wide) ** (1.0 / 3.0) * 0.5 * math.pi / wide
    return TurningAir(math.sqrt(variance), (V / wide, V / wide, V / (0.75 * wide)), V)


def wind_texts(plan: Plan) -> list[tuple[float, int | None, str]]:
    """Return begin and end of each discrete gust as (time s, UAV, text)."""
    texts: list[tuple[float, int | None, str]] = []
    for fields in plan.gusts:
        parts = [f"{name} {getattr(fields, name):g} m/s" for name in ("along", "right", "up") if getattr(fields, name)]
        kind = "gust" if fields.held else "1-cosine gust"
        for uav in [None] if fields.uavs is None else fields.uavs:
            texts.append((fields.at, uav, f"{kind} {', '.join(parts)} within {fields.length:g} m"))
            if fields.until is not None:
                texts.append((fields.until, uav, f"gust {', '.join(parts)} falls"))
    return texts
