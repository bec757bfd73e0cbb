"""Name UAVs and describe their state in words, the same in all views."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ftcc.airside.diagnosis.beliefs import FAULTY, HEALTHY, KINDS, STATES, UNDETERMINED
from ftcc.groundside.dashboard.snapshot import Pace, Snapshot, UavState

__all__ = [
    "HEALTH",
    "LEFT",
    "believed_state",
    "describe_beliefs",
    "describe_distrust",
    "describe_faults",
    "describe_silence",
    "faulty_actuators",
    "health_of",
    "in_trouble",
    "is_silent",
    "label",
    "name",
]

HEALTH = (*STATES, "left")
"""What a UAV says of itself: the most severe state of its actuators, or that it has left the swarm."""
LEFT = len(STATES)

_SILENT = 1.0
"""Age of a UAV's telemetry from which it counts as silent, s; wall time if it flies faster than real time."""


def name(uav: int) -> str:
    """Return the name of a UAV."""
    return f"UAV {uav}"


def label(uav: int, leads: bool, snapshot: Snapshot, brief: bool = False) -> str:
    """Return the label of an aircraft: its name, and its faults or silence; ``brief`` leaves details to the table."""
    called = name(uav) + (" leader" if leads else "")
    state = snapshot.uavs.get(uav)
    if state is None:
        return f"{called}: no telemetry"
    broken = len(faulty_actuators(state))
    faults = f"{broken} faults" if broken > 1 else "fault" if broken and brief else describe_faults(state)
    trouble = describe_silence(state, snapshot) or faults
    return f"{called}: {trouble}" if trouble else called


def describe_faults(uav: UavState) -> str:
    """Describe the faulty actuators; empty if there are none. A bias is given only if one actuator is faulty."""
    broken = faulty_actuators(uav)
    words = [f"{actuator.replace('_', ' ')} {100.0 * uav.effectiveness[actuator]:.0f} %" for actuator in broken]
    if len(words) == 1:
        bias = uav.bias.get(broken[0], 0.0)
        return words[0] + (f" {bias:+.2g}" if bias else "")
    return ", ".join(words)


def faulty_actuators(uav: UavState) -> list[str]:
    """Return the names of the actuators that do not act as commanded."""
    return [name for name, left in uav.effectiveness.items() if left != 1.0 or uav.bias.get(name, 0.0) != 0.0]


def describe_silence(uav: UavState, snapshot: Snapshot) -> str:
    """Describe since when a UAV has been silent; empty if it is not."""
    return f"silent since {uav.t:.0f} s" if is_silent(uav, snapshot) else ""


def is_silent(uav: UavState, snapshot: Snapshot) -> bool:
    """Return whether a UAV has fallen silent.

    Telemetry arrives at most ten times per second of wall time, so that in a fast swarm it is older in simulated time.
    """
    age = snapshot.t - uav.t
    return age > _SILENT and age > _SILENT * _fastest(snapshot.pace)


def _fastest(pace: Pace | None) -> float:
    """Return the largest pace at which the swarm may be flying, times real time."""
    if pace is None:
        return 1.0
    if pace.asked is None:
        return math.inf if math.isnan(pace.factor) else pace.factor
    return pace.asked if math.isnan(pace.factor) else max(pace.asked, pace.factor)


def in_trouble(uav: UavState, snapshot: Snapshot) -> bool:
    """Return whether a UAV has an actuator fault, believes to have one, or is silent."""
    return is_silent(uav, snapshot) or bool(faulty_actuators(uav)) or (health_of(uav) or HEALTHY) >= UNDETERMINED


def health_of(uav: UavState) -> int | None:
    """Return what a UAV says of itself, index into `HEALTH`; None if it does not diagnose, or has not yet."""
    worst = uav.signals.get("health", math.nan)
    if not math.isfinite(worst):
        return None
    return LEFT if uav.signals.get("belongs") == 0.0 else int(worst)


def believed_state(uav: UavState, actuator: str) -> str:
    """Return what a UAV believes of an actuator: the kind of its fault, else its state; empty if it is not known."""
    state = uav.signals.get(f"health_{actuator}", math.nan)
    if not math.isfinite(state):
        return ""
    return KINDS[int(uav.signals[f"kind_{actuator}"])] if state == FAULTY else STATES[int(state)]


def describe_beliefs(uav: UavState, actuators: Iterable[str]) -> str:
    """Describe what a UAV believes of its actuators, such as "elevator loss 62 % +0.01"; empty if it does not."""
    health = health_of(uav)
    if health is None:
        return ""
    words = ["left the swarm"] if health == LEFT else []
    for actuator in actuators:
        state = believed_state(uav, actuator)
        if state in ("", STATES[HEALTHY]):
            continue
        text = f"{actuator.replace('_', ' ')} {state}"
        if uav.signals[f"health_{actuator}"] == FAULTY:
            share, bias = uav.signals[f"effectiveness_hat_{actuator}"], uav.signals[f"bias_hat_{actuator}"]
            text += f" {100.0 * share:.0f} % {bias:+.2g}"
        words.append(text)
    return "; ".join(words) or STATES[HEALTHY]


_LITTLE_TRUST = 0.5
"""Below it a sender counts as distrusted."""


def describe_distrust(uav: UavState) -> str:
    """Whom a UAV distrusts, as "distrusts 2, 5"; empty: nobody."""
    doubted = sorted(sender for sender, link in uav.links.items() if link.trust < _LITTLE_TRUST)
    return f"distrusts {', '.join(map(str, doubted))}" if doubted else ""
