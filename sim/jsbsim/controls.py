"""The controls of an aircraft: how far its surfaces travel and which way they turn it, and what its engines give."""

from __future__ import annotations

import bisect
import functools
import math
from dataclasses import dataclass

import numpy as np

from ftcc.link.actuators import ACTUATORS
from ftcc.sim.jsbsim.aircraft import Aircraft, JsbsimError
from ftcc.sim.jsbsim.bench import Bench, Commands, Pose, throttles_of

__all__ = ["NO_CONTROL", "Control", "Controls", "controls_of"]

_SAMPLES = 21
"""Commands at which a travel is measured."""
_LEAST_MOMENT = 1e-3
"""Angular acceleration of full travel below which an aircraft does not have a surface, rad/s^2."""

_MEASURED = {
    "aileron": ("fcs/left-aileron-pos-rad", "fcs/right-aileron-pos-rad", "fcs/aileron-pos-rad"),
    "elevator": ("fcs/elevator-pos-rad",),
    "rudder": ("fcs/rudder-pos-rad",),
}
"""Where JSBSim's aircraft tell a surface's position; of several that move, the first counts."""
_AXIS = {"aileron": "p_dot", "elevator": "q_dot", "rudder": "r_dot"}
_UNTOLD_TRAVEL = 0.35
"""Travel that a surface is taken to have whose aircraft does not tell its position, rad."""


@dataclass(frozen=True)
class Control:
    """The map between a command to JSBSim and what it does."""

    commands: tuple[float, ...]
    """Ascending, fractions of travel or of the throttle."""
    effects: tuple[float, ...]
    """Deflection (rad, positive: turns about its axis negatively) or thrust (N) of each."""

    @property
    def least(self) -> float:
        return min(self.effects)

    @property
    def most(self) -> float:
        return max(self.effects)

    def command(self, effect: float) -> float:
        """Return the command for a deflection or thrust, the nearest possible one."""
        effects, commands = self._rising
        n = min(max(bisect.bisect_right(effects, effect), 1), len(effects) - 1)
        share = (effect - effects[n - 1]) / (effects[n] - effects[n - 1]) if len(effects) > 1 else 0.0
        return commands[n - 1] + min(max(share, 0.0), 1.0) * (commands[n] - commands[n - 1])

    @functools.cached_property
    def _rising(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Effects, ascending, and their commands."""
        if self.effects[0] < self.effects[-1]:
            return self.effects, self.commands
        return self.effects[::-1], self.commands[::-1]


NO_CONTROL = Control((0.0,), (0.0,))
"""Of an actuator that an aircraft does not have."""


@dataclass(frozen=True)
class Controls:
    """The controls of an aircraft, in the order of ``ftcc.link.actuators.ACTUATORS``."""

    aileron: Control
    elevator: Control
    rudder: Control
    thrust: Control

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the actuators that the aircraft does not have."""
        return tuple(name for name in ACTUATORS if getattr(self, name) == NO_CONTROL)

    def commands(self, aileron: float, elevator: float, rudder: float, thrust: float) -> Commands:
        """Return the commands for deflections (rad) and thrust (N)."""
        return Commands(
            self.aileron.command(aileron),
            self.elevator.command(elevator),
            self.rudder.command(rudder),
            self.thrust.command(thrust),
        )


@functools.cache
def controls_of(aircraft: Aircraft, V: float, altitude: float) -> Controls:
    """Measure the controls of an aircraft at ``V`` (m/s) and ``altitude`` (m).

    Thrust is that of the steady engines at this airspeed and altitude. In flight a throttle gives another thrust at
    another airspeed, and later: our laws must cope with that, as on a real aircraft.

    Raises
    ------
    JsbsimError
        If JSBSim fails there.
    """
    bench = Bench(aircraft)
    surfaces = {name: _surface(bench, name, V, altitude) for name in _AXIS}
    return Controls(**surfaces, thrust=_thrust(bench, V, altitude))


def _surface(bench: Bench, name: str, V: float, altitude: float) -> Control:
    commands = np.linspace(-1.0, 1.0, _SAMPLES)
    positions: dict[str, list[float]] = {}
    turning = []
    for command in commands:
        bench.set(Pose(V, altitude), Commands(**{name: float(command)}))
        turning.append(getattr(bench.accelerations(), _AXIS[name]))
        for place in _MEASURED[name]:
            value = bench.read(place)
            if value is not None:
                positions.setdefault(place, []).append(value)
    if not np.isfinite(turning).all() or max(turning) - min(turning) < _LEAST_MOMENT:
        return NO_CONTROL
    told = [np.array(values) for values in positions.values() if max(values) - min(values) > math.radians(1.0)]
    moved = told[0] if told else _UNTOLD_TRAVEL * commands
    rising = np.polyfit(moved, turning, 1)[0] > 0.0
    effects = -moved if rising else moved
    kept = _monotone(effects)
    return Control(tuple(commands[kept].tolist()), tuple(effects[kept].tolist()))


def _monotone(effects: np.ndarray) -> list[int]:
    """Return the numbers of the longest run of samples around the middle in which the effect only rises, or falls."""
    way = 1.0 if effects[-1] > effects[0] else -1.0
    steps = way * np.diff(effects) > 1e-9
    middle = len(effects) // 2
    first = last = middle
    while last < len(steps) and steps[last]:
        last += 1
    while first > 0 and steps[first - 1]:
        first -= 1
    if first == last:
        raise JsbsimError("a surface does not move with its command")
    return list(range(first, last + 1))


def _thrust(bench: Bench, V: float, altitude: float) -> Control:
    if not throttles_of(bench.model):
        return NO_CONTROL
    throttles = np.linspace(0.0, 1.0, _SAMPLES)
    forces = []
    for throttle in throttles:
        bench.set(Pose(V, altitude), Commands(throttle=float(throttle)))
        forces.append(bench.thrust())
    # Where more throttle gives no more thrust, the least one counts.
    kept = [0]
    for n in range(1, _SAMPLES):
        if forces[n] > forces[kept[-1]] + 1e-6:
            kept.append(n)
    if len(kept) < 2:
        return NO_CONTROL
    return Control(tuple(throttles[kept].tolist()), tuple(forces[n] for n in kept))
