"""Judges a flight from its recording: tracking errors, bounds, saturation, limit cycles, losses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.claims import Signals, evaluate_expression, names_in, recorded_names
from ftcc.groundside.verdict.oscillation import is_forced, oscillation
from ftcc.groundside.verdict.verdict import LimitCycle, Loss, Outside, Saturation, TrackingError, Verdict
from ftcc.link.actuators import SLOT, unit_of
from ftcc.sim.plants import conditions_of, find

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["columns_judged", "judge"]

Array = NDArray[np.float64]
_MEMORY = 32 << 20
"""Bytes of computed values that are kept for reuse."""

END, LEAST_END = 0.05, 2.0
"""The end of a flight, for errors and bounds: share of its duration, and least duration, s."""
HULL = 1.0
"""Allowed distance outside the leaders' hull, m; counts after a UAV was inside for the first time."""
LONG = 0.2
"""Share of a flight for which an actuator may be at its limits without a remark."""
RIPPLE = 0.02
"""Largest allowed amplitude of an actuator's oscillation, as a share of its travel."""
ALLOWED = {"m": 5.0, "m/s": 1.0, "rad": 0.1}
"""Allowed tracking error at the end if the scheme gives none, by unit; other units are reported, not judged."""

_AT_LIMIT = 1e-6
"""Tolerance at a limit, as a share of the travel: commands are float32."""
_NO_LIMIT = 1e6
"""A travel above this counts as unlimited."""
_TOGETHER = 2.0
"""UAVs whose recordings end within this time flew to the end, s: processes stop one after the other."""
_CLOSE = 1e-6
"""Tolerance for equal times, s."""

_HULLS = {"x_d": ("hull_distance_x", "hull of the leaders' positions"),
          "z_d": ("hull_distance", "hull of the leaders' altitudes")}  # fmt: skip
"""Followers of several leaders must be between their altitudes and, if they track ``x_d``, between their positions."""

_LED = ("z", "V")
"""Columns of leaders whose oscillations followers follow."""


def judge(signals: Signals, mission: Mission, lost: Mapping[int, tuple[float, str]]) -> Verdict:
    """Judge how a flight went.

    Parameters
    ----------
    signals : Signals
        The recording.
    mission : Mission
    lost : mapping
        Time (s) and cause of each loss, by UAV.
    """
    flight = _Flight(signals, mission, lost)
    saturation = sorted(_saturation(flight), key=lambda one: -one.share)
    return Verdict(
        flown=flight.end if flight.end < mission.timing.duration - flight.row - _CLOSE else mission.timing.duration,
        planned=mission.timing.duration,
        tracking=tuple(_tracking(flight)),
        outside=tuple(_outside(flight)),
        saturation=tuple(saturation),
        saturated=tuple(one for one in saturation if one.share > LONG),
        limit_cycles=tuple(_limit_cycles(flight)),
        lost=tuple(_losses(flight)),
    )


def columns_judged(mission: Mission) -> frozenset[str]:
    """Return the recorded columns that `judge` may look at in a flight of this mission."""
    scheme, plant = mission.scheme, mission.plant
    expressions = [error.name for error in scheme.tracking]
    expressions += [error.bound for error in scheme.tracking if isinstance(error.bound, str)]
    for signal in mission.signals:
        if signal.bound is not None:
            expressions += [signal.name, str(signal.bound)]
    if len(mission.graph.leaders) > 1:
        expressions += [distance for distance, _ in _HULLS.values()]
    names = [*_LED, *(f"{name}_command" for name in find(plant).ACTUATORS), *_causes(mission)]
    return frozenset(names).union(*map(recorded_names, expressions))


class _Flight:
    """A recording together with its mission."""

    def __init__(self, signals: Signals, mission: Mission, lost: Mapping[int, tuple[float, str]]) -> None:
        self.signals = signals
        self.mission = mission
        self.graph = mission.graph
        self.lost = lost
        self._values: dict[tuple[str, int], Array] = {}
        self._room = _MEMORY
        self.row = mission.timing.record_every * mission.timing.period
        """Time from row to row, s."""
        self.until = {uav: float(t[-1]) for uav in signals.uavs if len(t := signals.column("t", uav))}
        """When the recording of a UAV ends, s."""
        self.end = max(self.until.values(), default=0.0)
        self.end_begins = self.end - min(max(END * self.end, LEAST_END), self.end / 2.0) - _CLOSE
        """When the end begins, s."""
        self.followers = [uav for uav in self.graph.followers if uav in self.until]

    def times(self, uav: int) -> Array:
        """Return the times of a UAV's rows (n,), s."""
        return self.signals.column("t", uav)

    def lasted(self, uav: int) -> bool:
        """Return whether a UAV flew to the end."""
        return uav not in self.lost and self.until.get(uav, -1.0) >= self.end - _TOGETHER

    def values(self, expression: str, uav: int) -> Array:
        """Return the values (n,) of an expression at all times of a UAV."""
        found = self._values.get((expression, uav))
        if found is None:
            found = evaluate_expression(expression, self.signals, self.graph, uav)
            if found.nbytes <= self._room:
                self._room -= found.nbytes
                self._values[expression, uav] = found
        return found

    def can_evaluate(self, expression: str) -> bool:
        """Return whether the recording has all columns; columns of the hull need leaders that reach all followers."""
        names = names_in(expression)
        places = names & (set(_HULLS) | {name for name, _ in _HULLS.values()})
        led = bool(self.graph.leaders) and set(self.graph.followers) <= self.graph.reached_from(self.graph.leaders)
        return names - places <= set(self.signals.names) and (led or not places)


def _losses(flight: _Flight) -> Iterator[Loss]:
    for uav in flight.mission.uavs:
        if uav in flight.lost:
            yield Loss(uav, *flight.lost[uav])
        elif flight.end > 0.0 and not flight.lasted(uav):
            why = "its recording ends" if uav in flight.until else "it has no recording"
            yield Loss(uav, flight.until.get(uav, 0.0), why)


def _tracking(flight: _Flight) -> Iterator[TrackingError]:
    """Yield every tracking error that the scheme declares."""
    for error in flight.mission.scheme.tracking:
        if not flight.can_evaluate(error.name):
            continue
        largest, end = (-1.0, 0, 0.0), (-1.0, 0)
        too_large = False
        for uav in flight.followers:
            t = flight.times(uav)
            x = np.abs(flight.values(error.name, uav))
            there = np.flatnonzero(np.isfinite(x))
            if not len(there):
                continue
            worst = there[int(np.argmax(x[there]))]
            largest = max(largest, (float(x[worst]), uav, float(t[worst])), key=lambda one: one[0])
            late = there[t[there] >= flight.end_begins]
            if flight.lasted(uav) and len(late):
                end = max(end, (float(x[late].max()), uav), key=lambda one: one[0])
                allowed = _allowed(flight, error.bound, error.unit, uav)
                too_large |= allowed is not None and bool((x[late] > np.broadcast_to(allowed, x.shape)[late]).any())
        if largest[0] < 0.0:
            continue
        size, whose = end if end[1] else (None, None)
        small = None if whose is None else _allowed(flight, error.bound, error.unit, whose)
        # If the bound is a signal, its last value is reported.
        least = None if small is None else float(np.ravel(small)[-1])
        yield TrackingError(error.name, error.unit, error.meaning, *largest, size, whose, least, too_large)


def _allowed(flight: _Flight, bound: float | str | None, unit: str, uav: int) -> Array | float | None:
    if isinstance(bound, str):
        return np.abs(flight.values(bound, uav))
    return bound if bound is not None else ALLOWED.get(unit)


def _outside(flight: _Flight) -> Iterator[Outside]:
    """Yield the bounds of signals, and the leaders' hull, that a UAV left."""
    for signal in flight.mission.signals:
        for uav in flight.followers if signal.bound is not None else ():
            bound = np.abs(flight.values(str(signal.bound), uav))
            beyond = np.abs(flight.values(signal.name, uav)) > bound
            name = f"bound {signal.bound} of {signal.name}"
            yield from _times_outside(flight, name, signal.meaning, uav, beyond)
    if len(flight.graph.leaders) < 2:
        return
    tracked = frozenset[str]().union(*(names_in(error.name) for error in flight.mission.scheme.tracking))
    for place, (distance, name) in _HULLS.items():
        asked = place in tracked or place == "z_d"
        for uav in flight.followers if asked and flight.can_evaluate(distance) else ():
            away = flight.values(distance, uav)
            inside = away <= HULL
            was_inside = np.logical_or.accumulate(inside) | ~inside.any()
            beyond = was_inside & (away > HULL)
            yield from _times_outside(flight, name, f"more than {HULL:g} m outside", uav, beyond)


def _times_outside(flight: _Flight, name: str, meaning: str, uav: int, beyond: NDArray[np.bool_]) -> Iterator[Outside]:
    rows = np.flatnonzero(beyond)
    if len(rows):
        until = float(flight.times(uav)[rows[-1]])
        at_end = flight.lasted(uav) and until >= flight.end_begins
        yield Outside(name, meaning, uav, len(rows) * flight.row, until, at_end)


class _Actuator(NamedTuple):
    name: str
    low: float
    high: float

    @property
    def travel(self) -> float:
        return self.high - self.low


def _actuators(flight: _Flight, uav: int) -> list[_Actuator]:
    """Return the actuators of a UAV that have a limited travel."""
    limits = next(vehicle.limits for vehicle in flight.mission.vehicles if vehicle.uav == uav)
    found = [_Actuator(name, *limits[SLOT[name]]) for name in find(flight.mission.plant).ACTUATORS]
    return [one for one in found if 0.0 < one.travel < _NO_LIMIT]


def _saturation(flight: _Flight) -> Iterator[Saturation]:
    for uav in flight.followers:
        for actuator in _actuators(flight, uav):
            command = flight.signals.column(f"{actuator.name}_command", uav)
            close = _AT_LIMIT * actuator.travel
            share = float(((command <= actuator.low + close) | (command >= actuator.high - close)).mean())
            if share > 0.0:
                yield Saturation(actuator.name, uav, share)


def _limit_cycles(flight: _Flight) -> Iterator[LimitCycle]:
    """Yield the worst oscillation of each UAV, relative to the allowed amplitude."""
    commanded: list[float] | None = None
    worst: dict[int, tuple[float, LimitCycle]] = {}
    for uav, name, unit, signal, floor in _oscillating(flight):
        found = oscillation(flight.times(uav), flight.values(signal, uav), floor)
        if found is None or (uav in worst and found.amplitude / floor <= worst[uav][0]):
            continue
        commanded = _commanded_frequencies(flight) if commanded is None else commanded
        if not is_forced(found.frequency, commanded):
            worst[uav] = found.amplitude / floor, LimitCycle(name, unit, uav, *found)
    for uav in flight.followers:
        if uav in worst:
            yield worst[uav][1]


def _oscillating(flight: _Flight) -> Iterator[tuple[int, str, str, str, float]]:
    """Yield each signal to check: UAV, name, unit, column or expression, allowed amplitude.

    The order is signal by signal, for all UAVs, as a recording is read.
    """
    lasting = [uav for uav in flight.followers if flight.lasted(uav)]
    actuators = {uav: {one.name: one for one in _actuators(flight, uav)} for uav in lasting}
    for name in find(flight.mission.plant).ACTUATORS:
        for uav in lasting:
            if name in actuators[uav]:
                yield uav, name, unit_of(name), f"{name}_command", RIPPLE * actuators[uav][name].travel
    for error in flight.mission.scheme.tracking:
        floor = error.bound if isinstance(error.bound, float) else ALLOWED.get(error.unit)
        if floor is not None and flight.can_evaluate(error.name):
            for uav in lasting:
                yield uav, error.name, error.unit, error.name, floor


def _causes(mission: Mission) -> list[str]:
    """Return the columns of followers whose oscillations cause others."""
    own = [signal.name for signal in mission.signals if signal.shown_as == "reference"]
    return own + [name for name, _ in conditions_of(mission.plant)]


def _commanded_frequencies(flight: _Flight) -> list[float]:
    """Return the frequencies that the scenario or the ground station causes, rad/s.

    They come from the leaders' motion, from the UAVs' own references, and from periodic faults and disturbances, such
    as an intermittent fault.
    """
    signals = flight.signals
    columns = [(uav, name) for uav in flight.graph.leaders if uav in flight.until for name in _LED]
    columns += [(uav, name) for name in _causes(flight.mission) if name in signals.names for uav in flight.followers]
    found = (oscillation(flight.times(uav), signals.column(name, uav)) for uav, name in columns)
    return [one.frequency for one in found if one is not None]
