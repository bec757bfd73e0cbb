"""The settings of diagnosis and accommodation, by name as those of a scheme.

Thresholds belong to an aircraft, its sensors and its air: ``ftcc calibrate`` finds those with which no healthy flight
of a scenario raises an alarm. The values here are those of the reference aircraft.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

from ftcc.airside import ranges
from ftcc.airside.scheme import Quantity
from ftcc.airside.settings import settings_with

__all__ = ["DIAGNOSIS_RANGES", "DiagnosisGains", "diagnosis_gains"]

Q = Quantity


class DiagnosisGains(NamedTuple):
    """Settings of the stage `diagnose`, then those of each actuator, then those by which the swarm makes room."""

    bandwidth: Annotated[float, Q("bandwidth", "rad/s", "of the observers whose residuals are tested", 20.0)]
    memory: Annotated[float, Q("memory", "s", "time in which a change that raised no alarm is learned", 30.0)]
    sd_speed: Annotated[float, Q("sd_speed", "m/s", "noise of the airspeed", 0.05)]
    sd_angle: Annotated[float, Q("sd_angle", "rad", "noise of attitude, flight path and course", 0.002)]
    sd_rate: Annotated[float, Q("sd_rate", "rad/s", "noise of the body rates", 0.005)]
    sd_coefficient: Annotated[float, Q("sd_coefficient", "-", "error of a nominal coefficient", 0.1)]
    sd_effectiveness: Annotated[float, Q("sd_effectiveness", "-", "spread of effectiveness at an alarm", 0.6)]
    determined: Annotated[float, Q("determined", "-", "deviation below which effectiveness is determined", 0.1)]
    lasting: Annotated[float, Q("lasting", "s", "time that a navigation fault excuses alarms", 1.0)]
    slip: Annotated[float, Q("slip", "rad/s", "mismatch of attitude and body rates of a navigation fault", 0.08)]
    timeout: Annotated[float, Q("timeout", "s", "time after which an alarm without a fault is taken back", 6.0)]
    pace: Annotated[float, Q("pace", "1/s", "fastest change of the effectiveness that the law is told", 2.0)]
    least: Annotated[float, Q("least", "-", "least effectiveness that the law is told", 0.2)]
    dither: Annotated[float, Q("dither", "-", "amplitude of the excitation, share of the travel; 0: none", 0.0)]
    dither_frequency: Annotated[float, Q("dither_frequency", "rad/s", "its frequency", 6.0)]
    drift_thrust: Annotated[float, Q("drift_thrust", "N", "additive effect that is never tested", 3.5)]
    drift_elevator: Annotated[float, Q("drift_elevator", "rad", "likewise", 0.056)]
    drift_aileron: Annotated[float, Q("drift_aileron", "rad", "likewise", 0.03)]
    drift_rudder: Annotated[float, Q("drift_rudder", "rad", "likewise", 0.05)]
    drift_load_factor: Annotated[float, Q("drift_load_factor", "-", "likewise", 0.04)]
    drift_bank: Annotated[float, Q("drift_bank", "rad", "likewise", 0.02)]
    limit_thrust: Annotated[float, Q("limit_thrust", "N s", "sum of what exceeds the drift that is an alarm", 2.5)]
    limit_elevator: Annotated[float, Q("limit_elevator", "rad s", "likewise", 0.005)]
    limit_aileron: Annotated[float, Q("limit_aileron", "rad s", "likewise", 0.05)]
    limit_rudder: Annotated[float, Q("limit_rudder", "rad s", "likewise", 0.2)]
    limit_load_factor: Annotated[float, Q("limit_load_factor", "s", "likewise", 0.06)]
    limit_bank: Annotated[float, Q("limit_bank", "rad s", "likewise", 0.005)]
    spread_thrust: Annotated[float, Q("spread_thrust", "N sqrt(s)", "of what moves the aircraft beside it", 2.0)]
    spread_elevator: Annotated[float, Q("spread_elevator", "rad sqrt(s)", "likewise", 0.004)]
    spread_aileron: Annotated[float, Q("spread_aileron", "rad sqrt(s)", "likewise", 0.004)]
    spread_rudder: Annotated[float, Q("spread_rudder", "rad sqrt(s)", "likewise", 0.008)]
    spread_load_factor: Annotated[float, Q("spread_load_factor", "sqrt(s)", "likewise", 0.01)]
    spread_bank: Annotated[float, Q("spread_bank", "rad sqrt(s)", "likewise", 0.01)]
    fresh: Annotated[float, Q("fresh", "s", "age beyond which a neighbour's health is unknown", 2.0)]
    silent: Annotated[float, Q("silent", "s", "age beyond which leaders make no room for a follower", 20.0)]
    room: Annotated[float, Q("room", "-", "share of the weakest follower's climb rate that leaders use", 0.8)]
    room_pace: Annotated[float, Q("room_pace", "m/s^2", "fastest change of the leaders' limits", 0.2)]
    least_climb: Annotated[float, Q("least_climb", "m/s", "climb rate below which a faulty UAV leaves", 0.2)]
    astray: Annotated[float, Q("astray", "m", "distance from its place beyond which a faulty UAV leaves", 8.0)]
    astray_angle: Annotated[float, Q("astray_angle", "rad", "likewise, error of its attitude", 0.3)]
    leaving: Annotated[float, Q("leaving", "s", "time after which it leaves", 3.0)]
    returning: Annotated[float, Q("returning", "s", "time after which one that is healthy again comes back", 5.0)]
    fading: Annotated[float, Q("fading", "s", "time in which an edge fades out of the sums, or in", 3.0)]


_BY_ACTUATOR = ["thrust", "elevator", "aileron", "rudder", "load_factor", "bank"]

DIAGNOSIS_RANGES = {
    ranges.FREQUENCY: "bandwidth dither_frequency",
    ranges.FILTER_TIME: "memory lasting timeout fresh silent leaving returning fading",
    ranges.LIMIT: " ".join(
        [
            "sd_speed sd_angle sd_rate sd_coefficient sd_effectiveness determined slip pace",
            "room_pace astray astray_angle",
            *(f"{word}_{name}" for word in ("drift", "limit", "spread") for name in _BY_ACTUATOR),
        ]
    ),
    ranges.LIMIT_OR_OFF: "least_climb",
    ranges.SHARE: "least dither room",
}


def diagnosis_gains(overrides: Mapping[str, float]) -> DiagnosisGains:
    """The settings with ``overrides``.

    Raises
    ------
    ValueError
        For a name that there is not, or a value out of its range.
    """
    return settings_with(DiagnosisGains, DIAGNOSIS_RANGES, overrides)  # type: ignore[no-any-return]
