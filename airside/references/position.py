"""A UAV's own place at a forest fire: the elliptical fire-spread model of chapter 9, a post that circles its border.

The fire breaks out ``age`` seconds before t = 0; its half axes grow with ``spread_north`` and ``spread_east``, its
centre drifts with the wind. A UAV's post is the border's point of phase omega t + phi, shifted by its safe distance.
The axes stay north and east.

The ground may set another place or drift of the fire from one simulated time on, the same for all UAVs. The fire is
there at once; the formation follows it through a shaper of limited speed and acceleration (not in the monograph).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.elements.filters import reference_shaper
from ftcc.airside.scheme import Quantity
from ftcc.link.compiled import compiled, fields, store

__all__ = [
    "Command",
    "Fire",
    "Reference",
    "border",
    "centre",
    "change_from_ground",
    "moved",
    "newest",
    "refer",
    "stand",
    "start",
]

Q = Quantity


class Reference(NamedTuple):
    """Commanded motion of one UAV, north, east and up, and of the formation's centre."""

    x: float
    """m."""
    y: float
    z: float
    x_dot: float
    """m/s."""
    y_dot: float
    z_dot: float
    x_ddot: float
    """m/s^2."""
    y_ddot: float
    z_ddot: float
    north: float
    """Centre of the formation, m."""
    east: float
    north_dot: float
    """m/s."""
    east_dot: float
    north_ddot: float
    """m/s^2."""
    east_ddot: float


class Fire(NamedTuple):
    """What a UAV knows of the fire and of its own post: its mission parameters."""

    spread_north: Annotated[float, Q("a", "m/s", "growth of the northern half axis", 1.2)]
    spread_east: Annotated[float, Q("b", "m/s", "growth of the eastern half axis", 0.8)]
    age: Annotated[float, Q("age", "s", "time since the outbreak, at t = 0", 1800.0)]
    omega: Annotated[float, Q("omega", "rad/s", "angular rate on the ellipse", 0.0327)]
    phase: Annotated[float, Q("phi", "rad", "phase on the ellipse")]
    safe_north: Annotated[float, Q("delta_1", "m", "safe distance, north")]
    safe_east: Annotated[float, Q("delta_2", "m", "safe distance, east")]
    altitude: Annotated[float, Q("delta_3", "m", "altitude")]
    shift_speed: Annotated[float, Q("v_s", "m/s", "fastest motion of the centre (not in paper)", 4.0)]
    shift_acceleration: Annotated[float, Q("a_s", "m/s^2", "its largest acceleration (not in paper)", 0.2)]


class Command(NamedTuple):
    """From ``at`` (s) on: the fire's centre is there and drifts like that."""

    at: float
    north: float
    """m, at ``at``."""
    east: float
    drift_north: float
    """m/s."""
    drift_east: float


_AT, _NORTH, _EAST, _DRIFT_NORTH, _DRIFT_EAST = range(len(Command._fields))
_X, _X_DOT, _X_DDOT, _CENTRE, _CENTRE_DOT, _CENTRE_DDOT = (
    Reference._fields.index(name) for name in ("x", "x_dot", "x_ddot", "north", "north_dot", "north_ddot")
)
"""The first of three axes, or, of the centre, of two."""


@compiled
def in_force(commands, t):
    """The latest row of ``commands`` (n, 5) whose time has come, before the first one the first."""
    latest = 0
    for n in range(commands.shape[0]):
        if commands[n, 0] <= t:
            latest = n
    return latest


@compiled
def centre(command, t):
    """North and east (m) of the fire's centre at ``t`` (s) under a row of commands."""
    since = t - command[_AT]
    return command[_NORTH] + command[_DRIFT_NORTH] * since, command[_EAST] + command[_DRIFT_EAST] * since


def moved(
    command: Command, at: float, centre_at: Sequence[float] | None = None, drift: Sequence[float] | None = None
) -> Command:
    """The command after ``command``: from ``at`` on another centre (m), another drift (m/s), or both."""
    north, east = centre_at if centre_at is not None else centre(command, at)
    return Command(at, north, east, *(drift if drift is not None else (command.drift_north, command.drift_east)))


def newest(commands: NDArray[np.float64]) -> Command:
    """The last command about the fire, by the ground or else by the scenario, be it in force yet or not."""
    given = np.flatnonzero(np.isfinite(commands[:, 0]))
    return Command(*commands[given[-1]].tolist())


def change_from_ground(commands: NDArray[np.float64], now: float, at: float, field: str, value: float) -> bool:
    """From ``at`` (s) on, one field of the fire's `Command` is ``value``, whatever the scenario still plans.

    Changes for the same time belong together. Returns False where a change for another time is still waiting.
    """
    if commands[-1, 0] != at:
        if now < commands[-1, 0] < math.inf:
            return False
        before = commands[in_force(commands, at)].copy()
        if commands[-1, 0] < math.inf:
            commands[-2] = commands[-1]
        commands[-1] = moved(Command(*before.tolist()), at)
    commands[-1, Command._fields.index(field)] = value
    return True


def border(fire: Fire, commands: Sequence[Command], t: float, points: int = 72) -> NDArray[np.float64]:
    """Points (points + 1, 2) north and east on the border of the fire at ``t`` (s), a closed line."""
    north, east = centre(commands[in_force(np.array(commands), t)], t)
    theta = np.linspace(0.0, 2.0 * math.pi, points + 1)
    grown = fire.age + t
    return np.column_stack(
        (north + fire.spread_north * grown * np.cos(theta), east + fire.spread_east * grown * np.sin(theta))
    )


@compiled
def _follow(reference, command, t, fire, h):
    """Advance the formation's centre by ``h`` seconds towards the fire's, as it is at ``t``, the step's beginning."""
    north, east = centre(command, t)
    # The shaper slows down over the distance that its acceleration allows.
    w = 2.0 * fire.shift_acceleration / fire.shift_speed
    for axis in range(2):
        z, v, a = reference[_CENTRE + axis], reference[_CENTRE_DOT + axis], reference[_CENTRE_DDOT + axis]
        target, rate = (north, command[_DRIFT_NORTH]) if axis == 0 else (east, command[_DRIFT_EAST])
        v_rate, a_rate, jerk = reference_shaper(z, v, a, target, rate, w, fire.shift_speed, fire.shift_acceleration)
        reference[_CENTRE + axis] = z + h * v_rate
        reference[_CENTRE_DOT + axis] = v + h * a_rate
        reference[_CENTRE_DDOT + axis] = a + h * jerk


@compiled
def _place(reference, t, fire):
    """The post of a UAV around the formation's centre."""
    a, b, omega = fire.spread_north, fire.spread_east, fire.omega
    s = fire.age + t
    theta = omega * t + fire.phase
    cosine, sine = math.cos(theta), math.sin(theta)
    formation = fields(Reference, reference)
    post = Reference(
        x=formation.north + a * s * cosine + fire.safe_north,
        y=formation.east + b * s * sine + fire.safe_east,
        z=fire.altitude,
        x_dot=formation.north_dot + a * cosine - a * s * omega * sine,
        y_dot=formation.east_dot + b * sine + b * s * omega * cosine,
        z_dot=0.0,
        x_ddot=formation.north_ddot - 2.0 * a * omega * sine - a * s * omega * omega * cosine,
        y_ddot=formation.east_ddot + 2.0 * b * omega * cosine - b * s * omega * omega * sine,
        z_ddot=0.0,
        north=formation.north,
        east=formation.east,
        north_dot=formation.north_dot,
        east_dot=formation.east_dot,
        north_ddot=formation.north_ddot,
        east_ddot=formation.east_ddot,
    )
    store(post, reference)


@compiled
def refer(parameters, commands, reference, now_us, period_us):
    """Bring a UAV's reference to the tick at ``now_us``; until the fire is moved, its centre is followed exactly."""
    fire = fields(Fire, parameters)
    now = now_us / 1e6
    latest = in_force(commands, now)
    if latest == 0:
        reference[_CENTRE], reference[_CENTRE + 1] = centre(commands[0], now)
        reference[_CENTRE_DOT], reference[_CENTRE_DOT + 1] = commands[0, _DRIFT_NORTH], commands[0, _DRIFT_EAST]
        reference[_CENTRE_DDOT], reference[_CENTRE_DDOT + 1] = 0.0, 0.0
    elif now_us > 0:
        before = (now_us - period_us) / 1e6
        _follow(reference, commands[in_force(commands, before)], before, fire, period_us / 1e6)
    _place(reference, now, fire)


@compiled
def stand(reference, period_us):
    """Hold: straight on, at the present velocity."""
    for axis in range(3):
        reference[_X + axis] += reference[_X_DOT + axis] * period_us / 1e6
        reference[_X_DDOT + axis] = 0.0
    return False  # the fire burns on meanwhile


def start(fire: Fire, commands: Sequence[Command]) -> Reference:
    """The reference at t = 0."""
    row = np.zeros(len(Reference._fields))
    refer(np.array(fire), np.array(commands[:1]), row, 0, 1)
    return Reference(*row.tolist())
