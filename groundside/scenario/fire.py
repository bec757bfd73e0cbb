"""The fire of a scenario: each UAV's own reference, and whether its aircraft can fly it.

Thrust is never negative and has a limit. If a post needs negative thrust or more than the limit, no law holds the
formation: thrust stays at its limit and the error along the track grows by hundreds of metres.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.point_mass import drag
from ftcc.airside.references.position import Command, Fire, Reference, moved, refer, start
from ftcc.airside.spec import OwnReference
from ftcc.groundside.scenario.checks import Findings
from ftcc.groundside.scenario.trims import truth_at_start
from ftcc.groundside.schema import Plan
from ftcc.link.actuators import SLOT, unit_of
from ftcc.sim import plants
from ftcc.sim.faults import Fault
from ftcc.sim.plant import CHI, GAMMA, V
from ftcc.sim.spec import VehicleSpec

__all__ = ["check_posts", "fire_commands", "fire_references", "fire_texts"]

Array = NDArray[np.float64]

_GRID_US = 100_000
"""Sampling period of a reference, us."""
_NARROW = 0.01
"""A margin below this share of an actuator's travel gives a warning."""
_FAR = 60.0
"""Largest distance of a start from its post that was tested, m."""


def fire_commands(plan: Plan) -> tuple[Command, ...]:
    """Return position and drift of the fire's centre over time; the same for all UAVs."""
    assert plan.fire is not None
    fire = plan.fire
    place = [fire.outbreak[axis] + fire.drift[axis] * fire.age for axis in range(2)]
    commands = [Command(0.0, place[0], place[1], *fire.drift)]
    for event in plan.fire_events:
        before = commands[-1]
        commands.append(moved(before, event.at, event.centre, event.drift))
        if event.until is not None:
            commands.append(moved(commands[-1], event.until, None, (before.drift_north, before.drift_east)))
    return tuple(commands)


def fire_references(plan: Plan, followers: Sequence[int], findings: Findings) -> dict[int, OwnReference]:
    """Return each UAV's own reference, by id."""
    assert plan.fire is not None
    fire = plan.fire
    for uav in sorted({*fire.posts} ^ {*followers}):
        findings.refuse(f"fire.posts.{uav}: " + ("is missing" if uav in followers else f"there is no UAV {uav}"))
    changes = [command.at for command in fire_commands(plan)]
    if changes != sorted(changes) or len({event.at for event in plan.fire_events}) < len(plan.fire_events):
        findings.refuse("fire_events: must be in order of time, one at a time, each after the until of those before")
    for n, event in enumerate(plan.fire_events):
        if event.drift is not None and max(map(abs, event.drift)) >= fire.shift_speed:
            findings.refuse(
                f"fire_events.{n}.drift = {list(event.drift)}: must be below fire.shift_speed = "
                f"{fire.shift_speed:g} m/s, or the formation never catches up"
            )
    findings.stop_if_refused()
    commands = fire_commands(plan)
    own = {}
    for uav in followers:
        post = fire.posts[uav]
        parameters = Fire(
            *fire.spread, fire.age, fire.omega, post.phase, post.north, post.east, post.altitude,
            fire.shift_speed, fire.shift_acceleration,
        )  # fmt: skip
        own[uav] = OwnReference(start(parameters, commands), parameters, commands)
    return own


def fire_texts(plan: Plan) -> list[tuple[float, int | None, str]]:
    """Return the fire's changes as events: time s, UAV (None: all UAVs), text."""
    texts: list[tuple[float, int | None, str]] = []
    for event in plan.fire_events:
        parts = (
            []
            if event.centre is None
            else [f"its centre is at {event.centre[0]:g} m north, {event.centre[1]:g} m east"]
        )
        parts += [] if event.drift is None else [f"it drifts with {event.drift[0]:g}, {event.drift[1]:g} m/s"]
        texts.append((event.at, None, f"fire: {', '.join(parts)}"))
        if event.until is not None:
            texts.append((event.until, None, "fire: it drifts as before"))
    return texts


@dataclass(frozen=True)
class _Demand:
    """The demand of a post over time, without faults."""

    t: Array
    """(n,): s."""
    motion: Array
    """(n, 15): see `Reference`."""
    speed: Array
    """(n,): m/s."""
    inputs: dict[str, Array]
    """By actuator, (n,): N, load factor, rad."""


def _demand_of(own: OwnReference, vehicle: VehicleSpec, model: Any, duration: float) -> _Demand:
    rows = int(duration * 1e6) // _GRID_US + 1
    parameters, commands = np.array(own.parameters), np.array(own.commands)
    row = np.array(own.initial, np.float64)
    motion = np.zeros((rows, len(Reference._fields)))
    for k in range(rows):
        refer(parameters, commands, row, k * _GRID_US, _GRID_US)
        motion[k] = row
    t = np.arange(rows) * _GRID_US / 1e6
    channels = [name for name, _ in plants.find(vehicle.plant).DISTURBANCES]
    disturbance = np.zeros((rows, 3))
    for d in vehicle.disturbances:
        name = channels[int(d.channel)]
        if name.startswith("b_"):
            since = np.maximum(t - d.time, 0.0)
            grown = 1.0 - np.exp(-d.onset * since) if d.onset > 0.0 else 1.0
            swing = np.sin(d.frequency * since + d.phase) if d.frequency > 0.0 else 1.0
            disturbance[:, "xyz".index(name[2])] += np.where(
                (t >= d.time) & (t < d.until), d.value * grown * swing, 0.0
            )
    v = motion[:, 3:6]
    speed = np.sqrt((v * v).sum(axis=1))
    wanted = motion[:, 6:9] - disturbance
    wanted[:, 2] += model.g
    safe = np.maximum(speed, 1e-3)
    along = (wanted * v).sum(axis=1) / safe
    right = (wanted[:, 1] * v[:, 0] - wanted[:, 0] * v[:, 1]) / safe
    load = np.hypot(right, wanted[:, 2]) / model.g
    resistance = np.array([drag(float(V), float(n), model) for V, n in zip(speed, load, strict=True)])
    inputs = {
        "thrust": model.m * along + resistance,
        "load_factor": load,
        "bank": np.arctan2(right, wanted[:, 2]),
    }
    return _Demand(t, motion, speed, inputs)


def _effectiveness_and_bias(t: Array, faults: Sequence[Fault], slot: int) -> tuple[Array, Array]:
    """Return effectiveness and bias of an actuator over time, from its latest fault."""
    effectiveness, bias = np.ones_like(t), np.zeros_like(t)
    for fault in sorted(faults):
        if int(fault.actuator) == slot:
            since = np.maximum(t - fault.time, 0.0)
            lost = 1.0 - np.exp(-fault.effectiveness_onset * since) if fault.effectiveness_onset else np.ones_like(t)
            shifted = 1.0 - np.exp(-fault.bias_onset * since) if fault.bias_onset else np.ones_like(t)
            there = t >= fault.time
            effectiveness = np.where(there, 1.0 + (fault.effectiveness - 1.0) * lost, effectiveness)
            bias = np.where(there, fault.bias * shifted, bias)
    return effectiveness, bias


def check_posts(
    plan: Plan,
    references: Mapping[int, OwnReference],
    vehicles: Sequence[VehicleSpec],
    laws: Mapping[int, Mapping[str, tuple[float, float]]],
    model: Any,
    findings: Findings,
) -> None:
    """Refuse posts that are too close together or that an aircraft cannot fly; warn of small margins.

    ``laws`` holds the limits of each UAV's law, by actuator. The narrower of the law's and the plant's limits counts.
    """
    assert plan.fire is not None
    found = {v.uav: _demand_of(references[v.uav], v, model, plan.duration) for v in vehicles}
    _check_distances(plan.fire.least_distance, found, findings)
    refuse = findings.warn if plan.fire.beyond_limits else findings.refuse
    for vehicle in vehicles:
        demand = found[vehicle.uav]
        slowest = float(demand.speed.min())
        if slowest <= vehicle.guards.least_airspeed:
            refuse(
                f"fire.posts.{vehicle.uav}: demands a speed of {slowest:.1f} m/s; must exceed the lowest airspeed, "
                f"{vehicle.guards.least_airspeed:g} m/s"
            )
        for actuator, values in demand.inputs.items():
            law = laws[vehicle.uav].get(actuator, (-math.inf, math.inf))
            _check_actuator(vehicle, actuator, law, values, demand, refuse, findings)
        _check_start(vehicle, demand, findings)


def _check_actuator(
    vehicle: VehicleSpec,
    actuator: str,
    law: tuple[float, float],
    values: Array,
    demand: _Demand,
    refuse: Any,
    findings: Findings,
) -> None:
    slot, unit = SLOT[actuator], "" if unit_of(actuator) == "-" else f" {unit_of(actuator)}"
    low, high = max(vehicle.limits[slot][0], law[0]), min(vehicle.limits[slot][1], law[1])
    whose = "plant" if (low, high) == vehicle.limits[slot] else "law"
    effectiveness, bias = _effectiveness_and_bias(demand.t, vehicle.faults, slot)
    if effectiveness.min() <= 0.0:
        findings.warn(f"UAV {vehicle.uav}: {actuator} loses all effectiveness")
        return
    command = (values - bias) / effectiveness
    for worst, limit in ((int(command.argmin()), low), (int(command.argmax()), high)):
        value, scale, shift = command[worst], effectiveness[worst], bias[worst]
        at = f"at t = {demand.t[worst]:g} s and {demand.speed[worst]:.1f} m/s"
        text = f"fire.posts.{vehicle.uav}: demands {values[worst]:.3g}{unit} of {actuator} {at}"
        if scale < 1.0 or shift != 0.0:
            text += f", the command ({values[worst]:.3g} - {shift:.3g})/{scale:.3g} = {value:.3g}{unit}"
        if not low < value < high:
            refuse(f"{text}; the {whose} allows {low:g} to {high:g}{unit} (fire.beyond_limits = true flies it anyway)")
        elif abs(value - limit) < _NARROW * (high - low):
            findings.warn(f"{text}; close to its limit, {limit:g}{unit}")


def _check_start(vehicle: VehicleSpec, demand: _Demand, findings: Findings) -> None:
    true = truth_at_start(vehicle)
    away = float(np.linalg.norm(true[:3] - demand.motion[0, :3]))
    if away > _FAR:
        findings.warn(
            f"start of UAV {vehicle.uav}: {away:.0f} m from its post; starts up to {_FAR:g} m away were tested"
        )
    ground = true[V] * math.cos(true[GAMMA])
    own = np.array([ground * math.cos(true[CHI]), ground * math.sin(true[CHI]), true[V] * math.sin(true[GAMMA])])
    off = float(np.linalg.norm(own - demand.motion[0, 3:6]))
    if off > 0.5 * demand.speed[0]:
        findings.warn(f"start of UAV {vehicle.uav}: its velocity is {off:.1f} m/s off that of its post")


def _check_distances(least: float, found: Mapping[int, _Demand], findings: Findings) -> None:
    uavs = list(found)
    for n, i in enumerate(uavs):
        for j in uavs[n + 1 :]:
            distances = np.linalg.norm(found[i].motion[:, :3] - found[j].motion[:, :3], axis=1)
            nearest = int(distances.argmin())
            if distances[nearest] < least:
                findings.refuse(
                    f"fire.posts: UAV {i} and {j} come within {distances[nearest]:.1f} m of each other at "
                    f"t = {found[i].t[nearest]:g} s; must be at least fire.least_distance = {least:g} m"
                )
