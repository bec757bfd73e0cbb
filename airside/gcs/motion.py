"""A leader's motion as the ground asks for it: altitude and speed, obeyed as a whole or refused with the reason."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from ftcc.airside.gcs.answers import ACCEPTED, BUSY, DENIED, Answer, degrees_of
from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.model import level_deflections
from ftcc.airside.references.profiles import ALTITUDE, SPEED, climb_of_step, command_from_ground
from ftcc.link.flight_modes import HOLD
from ftcc.link.mavlink import as_typed, dialect

__all__ = ["altitude_above_home", "command_leader", "read_target"]

_M = dialect
_ABOVE_SEA = (_M.MAV_FRAME_GLOBAL, _M.MAV_FRAME_GLOBAL_INT)
_ABOVE_HOME = (_M.MAV_FRAME_GLOBAL_RELATIVE_ALT, _M.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)


def altitude_above_home(view: AutopilotView, altitude: float, frame: float | None) -> tuple[float, str]:
    """An altitude (m) above the origin, or why its frame means nothing here; without a frame it is above the sea."""
    if frame in _ABOVE_HOME:
        return as_typed(altitude), ""
    if frame is None or frame in _ABOVE_SEA:
        return as_typed(altitude) - view.home.altitude, ""
    return math.nan, f"frame {frame:g}: 0, 5 (above sea) or 3, 6 (above home)"


def command_leader(view: AutopilotView, altitude: float | None, speed: float | None) -> Answer:
    """Give a leader another altitude (m, z) or speed (m/s), at FTCC_AT."""
    if not view.leader or view.spec.profile is None:
        return Answer(DENIED, "a follower follows: command its leaders")
    if view.autopilots.mode[view.i] == HOLD:
        return Answer(BUSY, "in hold: set mode mission first")
    at_us, why = view.acting_time()
    why = why or _impossible(view, altitude, speed) or _cannot_be_followed(view, altitude, speed)
    if why:
        return Answer(DENIED, why)
    held = view.autopilots.held_us[view.i]
    i = view.i
    commands, triggers = view.autopilots.profile_commands[i], view.autopilots.profile_triggers[i]
    state = view.autopilots.profile_state[i]
    now, at = (float((t - held) / 1e6) for t in (view.next_us, at_us))
    if not command_from_ground(commands, triggers, state, now, at, altitude, speed):
        return Answer(BUSY, "too many commands are waiting")
    asked = [f"{altitude:g} m"] if altitude is not None else []
    asked += [f"{speed:g} m/s"] if speed is not None else []
    return Answer(ACCEPTED, event=f"leader commanded to {', '.join(asked)}{view.if_later(at_us)}")


def _impossible(view: AutopilotView, altitude: float | None, speed: float | None) -> str:
    """Why no aircraft of this kind can fly so; empty if it can."""
    if altitude is not None:
        if not abs(altitude) < 1e5:
            return f"altitude {altitude:g} m: beyond 100 km"
        if altitude < min(0.0, float(view.autopilots.profile_state[view.i, ALTITUDE])):
            return f"altitude {altitude:g} m above home: below the ground"
    if speed is None:
        return ""
    if not 0.0 < speed < 1e3:
        return f"speed {speed:g} m/s: must be positive"
    model = view.spec.model
    needed = level_deflections(speed, model)
    for name, unit in (("thrust", "N"), ("elevator", "rad")):
        if name not in view.scheme.commands:
            continue
        low, high = getattr(model, f"{name}_min"), getattr(model, f"{name}_max")
        if not low <= needed[name] <= high:
            return f"{speed:g} m/s needs {name} {needed[name]:.3g} of {low:.3g}..{high:.3g} {unit}"
    return ""


def _cannot_be_followed(view: AutopilotView, altitude: float | None, speed: float | None) -> str:
    """Why the scheme's conditions forbid a leader's command; empty if they do not."""
    profile, flight = view.spec.profile, view.spec.flight
    assert profile is not None
    if flight is None:
        return ""
    climb, varies = flight.leader_climb, flight.leader_speed_varies
    if altitude is not None:
        step = altitude - float(view.autopilots.profile_state[view.i, ALTITUDE])
        limit = profile.climb_limit if step > 0.0 else profile.sink_limit
        climb = max(climb, min(limit, climb_of_step(profile.altitude_filter, step)))
    if speed is not None:
        varies = varies or speed != float(view.autopilots.profile_state[view.i, SPEED])
    asked = dataclasses.replace(flight, leader_climb=climb, leader_speed_varies=varies)
    gains = view.scheme.gains_type(*view.spec.gains)
    before = {problem.text for problem in view.scheme.check(gains, flight) if problem.fatal}
    fatal = [p.text for p in view.scheme.check(gains, asked) if p.fatal and p.text not in before]
    return fatal[0] if fatal else ""


_IGNORES = {
    "x": _M.POSITION_TARGET_TYPEMASK_X_IGNORE,
    "y": _M.POSITION_TARGET_TYPEMASK_Y_IGNORE,
    "z": _M.POSITION_TARGET_TYPEMASK_Z_IGNORE,
    "vx": _M.POSITION_TARGET_TYPEMASK_VX_IGNORE,
    "vy": _M.POSITION_TARGET_TYPEMASK_VY_IGNORE,
    "vz": _M.POSITION_TARGET_TYPEMASK_VZ_IGNORE,
    "afx": _M.POSITION_TARGET_TYPEMASK_AX_IGNORE,
    "afy": _M.POSITION_TARGET_TYPEMASK_AY_IGNORE,
    "afz": _M.POSITION_TARGET_TYPEMASK_AZ_IGNORE,
    "yaw": _M.POSITION_TARGET_TYPEMASK_YAW_IGNORE,
    "yaw_rate": _M.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE,
}
"""The bit of the type mask by which each field is left out."""
_NORTH_AND_LEVEL = ("vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate")
"""Zero in them is how a leader flies: northward, level, steady."""


def read_target(view: AutopilotView, message: Any) -> tuple[float | None, float | None, str]:
    """Altitude (m, z) and forward speed (m/s) that a SET_POSITION_TARGET_* asks of a leader, or why it is refused.

    What its mask leaves out, and nan, is not given.
    """
    values = {name: float(getattr(message, name)) for name in _IGNORES if hasattr(message, name)}
    frame = message.coordinate_frame
    if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT":
        values |= {"x": degrees_of(message.lat_int), "y": degrees_of(message.lon_int)}
        values["z"], why = altitude_above_home(view, message.alt, frame)
    else:
        values["z"] = as_typed(-message.z)
        why = "" if frame == _M.MAV_FRAME_LOCAL_NED else f"frame {frame}: 1 (local NED)"
    asked = {n: v for n, v in values.items() if not message.type_mask & _IGNORES[n] and not math.isnan(v)}
    if not why and any(map(math.isinf, asked.values())):
        why = "a number is infinite"
    more = [n for n, v in asked.items() if n not in ("z", "vx") and (v != 0.0 or n not in _NORTH_AND_LEVEL)]
    if not why and more:
        why = f"{', '.join(more)}: only altitude and vx can change"
    altitude, speed = asked.get("z"), asked.get("vx")
    if not why and altitude is None and speed is None:
        why = "neither altitude nor forward speed"
    return altitude, None if speed is None else as_typed(speed), why and f"target: {why}"
