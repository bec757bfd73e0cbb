"""What diagnosis on board is asked in every flight of a study: numbers with bounds, as claims are, beside the headline.

A number is the largest of a flight's faults of actuators. A fault that was not found has no delay, and its bound fails.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ftcc.airside.diagnosis.beliefs import BIAS, FAULTY, KINDS, NOT_ACTUATOR, SENSOR, SLOW, STATES, STUCK
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.groundside.claims import tolerance_of
from ftcc.groundside.results import Run
from ftcc.groundside.schema import Claim
from ftcc.groundside.simulation import Flight
from ftcc.groundside.verdict import SIGMAS, Alarm, FaultFound, false_alarms, faults_found

__all__ = ["asked_of_diagnosis", "diagnosed", "is_right", "known_faults"]

_ASKED = (
    ("detection delay", "s", "< 0.5", "time from the onset of a fault to the alarm"),
    ("isolation delay", "s", "< 2", "time from the onset of a fault until its kind and actuator are known"),
    ("wrong kind or actuator", "-", "< 0.5", "number of detected faults of which another kind or actuator was found"),
    ("error of effectiveness", "-", "< 0.05", "of a determined estimate, 5 s after isolation"),
    (
        "error of effectiveness over its deviation",
        "-",
        f"< {SIGMAS:g}",
        "of a determined estimate, 5 s after isolation",
    ),
    ("false alarms", "-", "< 0.5", "number of alarms of aircraft without a fault"),
    ("navigation faults taken for an actuator's", "-", "< 0.5", "number of faults of actuators found amid them"),
)
"""Title, unit, bound and meaning."""


def asked_of_diagnosis(case: str, duration: float) -> tuple[Claim, ...]:
    """Return what the flights of a study are asked, in the form of claims; flights are of ``duration`` (s)."""
    return tuple(
        Claim(
            name=title,
            metric="max",
            signal=meaning,
            window=(0.0, duration),
            unit=unit,
            source="diagnosis",
            expected={case: 0.0},
            tolerance=bound,
        )
        for title, unit, bound, meaning in _ASKED
    )


def diagnosed(flight: Flight | Run) -> tuple[tuple[float | None, ...], tuple[bool | None, ...]]:
    """Return the number of each of `asked_of_diagnosis`, None where there is none, and whether its bound holds.

    Without diagnosis there is no number.
    """
    spec = flight.mission.autopilots[0].diagnosis
    if not spec.on:
        return (None,) * len(_ASKED), (None,) * len(_ASKED)
    faults, alarms = faults_found(flight), false_alarms(flight)
    found = [fault for fault in faults if math.isfinite(fault.detected)]
    known = known_faults(faults, DiagnosisGains(*spec.gains).determined)
    errors = [abs(fault.effectiveness_error) for fault in known]
    navigation = any(vehicle.navigation_faults for vehicle in flight.mission.vehicles)
    amid = [alarm for alarm in alarms if "navigation" in alarm.amid]
    values = (
        _largest([fault.detection_delay for fault in faults]),
        _largest([fault.isolation_delay for fault in faults]),
        float(sum(not is_right(fault, alarms) for fault in found)) if found else None,
        _largest(errors),
        _largest([error / fault.effectiveness_sd for error, fault in zip(errors, known, strict=True)]),
        float(sum(not alarm.amid for alarm in alarms)),
        float(sum(_is_an_actuators(alarm) for alarm in amid)) if navigation else None,
    )
    numbers = tuple(None if value is None or not math.isfinite(value) else value for value in values)
    holds = tuple(
        None if value is None else tolerance_of(bound).allows(value, 0.0)
        for value, (_, _, bound, _) in zip(values, _ASKED, strict=True)
    )
    return numbers, holds


def known_faults(faults: Sequence[FaultFound], determined: float) -> list[FaultFound]:
    """Return the faults whose effectiveness was known 5 s after isolation: to less than ``determined``.

    A stuck or a slow actuator has no effectiveness that could be known; that of one with a bias alone is no question.
    """
    without = (KINDS[BIAS], KINDS[STUCK], KINDS[SLOW])
    having = (fault for fault in faults if fault.true_kind not in without)
    return [fault for fault in having if fault.determined and 0.0 < fault.effectiveness_sd < determined]


def is_right(fault: FaultFound, alarms: Sequence[Alarm]) -> bool:
    """Return whether the kind of a fault was found, and no other actuator of the aircraft was taken for faulty too."""
    others = (alarm for alarm in alarms if alarm.uav == fault.uav and fault.onset <= alarm.begin < fault.until)
    return fault.kind == fault.true_kind and not any(_is_an_actuators(alarm) for alarm in others)


def _is_an_actuators(alarm: Alarm) -> bool:
    return alarm.state == STATES[FAULTY] and alarm.kind not in (KINDS[SENSOR], KINDS[NOT_ACTUATOR])


def _largest(numbers: Sequence[float]) -> float | None:
    """The largest; infinite where one is missing, None where there are none."""
    return max((math.inf if math.isnan(number) else number for number in numbers), default=None)
