"""The parameters of an autopilot: what the ground may read and set, each with its range and what setting it does.

Values in force are float64. A value that comes as float32 and rounds to the one in force leaves it as it is; a new one
is taken as the shortest decimal number that float32 stores so, which is what was typed: 0.7, not 0.699999988.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.defence.gains import DEFENCE_RANGES, DefenceGains
from ftcc.airside.diagnosis.gains import DIAGNOSIS_RANGES, DiagnosisGains
from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.gcs.schedule import SLOWEST
from ftcc.airside.gcs.streams import STREAMS
from ftcc.airside.gcs.telemetry import Telemetry
from ftcc.airside.ranges import Range
from ftcc.airside.references.position import Fire, change_from_ground, newest
from ftcc.airside.scheme import FAULT_TOLERANCE, Quantity, quantities
from ftcc.link.attacks import ATTACK_SIZES
from ftcc.link.channel import Channel
from ftcc.link.failures import SIZES, Size
from ftcc.link.mavlink import as_typed, dialect

__all__ = ["Parameter", "Parameters", "RefusedError", "defence_parameter", "diagnosis_parameter"]

_INTEGER = dialect.MAV_PARAM_TYPE_INT32
_FLOAT = dialect.MAV_PARAM_TYPE_REAL32
_ANY = 1e30
_CHANNEL = {
    "CH_LOSS": ("loss", 1.0, "probability that a record is lost"),
    "CH_BURST_S": ("burst_start", 1.0, "probability per record of entering a burst of losses"),
    "CH_BURST_E": ("burst_end", 1.0, "probability per record of leaving it"),
    "CH_BURST_L": ("burst_loss", 1.0, "probability of loss within a burst"),
    "CH_DELAY": ("delay", 1e2, "delay beyond the link latency, s"),
    "CH_JITTER": ("jitter", 1e2, "further delay, uniform in [0, jitter], s"),
}
"""Quality of all edges by which a UAV hears: field of `Channel`, largest value, meaning."""
_MOST_PERIODS = 30
"""Latency, delay and jitter together in exchange periods: the inbox keeps that many records."""


class RefusedError(ValueError):
    """A value that a parameter cannot have; the text says why."""


@dataclass
class Parameter:
    """One parameter."""

    name: str
    read: Callable[[], float]
    write: Callable[[float], None]
    """Brings a value into force, or raises `RefusedError`."""
    low: float
    high: float
    integer: bool = False
    meaning: str = ""


class Parameters:
    """All parameters of one autopilot, in a fixed order."""

    def __init__(self, view: AutopilotView, telemetry: Telemetry) -> None:
        self._view = view
        for sizes, known in ((view.failure_sizes, SIZES), (view.attack_sizes, ATTACK_SIZES)):
            sizes.update({size.name: size.default for size in known if size.name not in sizes})
        own = [
            *_system(view),
            *_set_up(),
            *_sizes(view.failure_sizes, SIZES),
            *_sizes(view.attack_sizes, ATTACK_SIZES),
            *_channel(view),
            *_fire(view),
            *_rates(view, telemetry),
            *_gains(view),
            *_diagnosis(view),
            *_defence(view),
        ]
        self._all = sorted(own, key=lambda parameter: parameter.name)
        self._index = {parameter.name.upper(): n for n, parameter in enumerate(self._all)}

    def __len__(self) -> int:
        return len(self._all)

    def find(self, name: str, index: int) -> int | None:
        """Place of the parameter with this index, or, if that is negative, with this name in any case of letters."""
        if index >= 0:
            return index if index < len(self._all) else None
        return self._index.get(name.upper())

    def name(self, n: int) -> str:
        """Name of the parameter in place ``n``."""
        return self._all[n].name

    def value(self, n: int) -> float:
        """Its value in force."""
        return self._all[n].read()

    def message(self, n: int) -> Any:
        """PARAM_VALUE with the value in force, integers byte for byte in the float."""
        parameter = self._all[n]
        value = parameter.read()
        if parameter.integer:
            value = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        kind = _INTEGER if parameter.integer else _FLOAT
        return dialect.MAVLink_param_value_message(parameter.name.encode(), value, kind, len(self._all), n)

    def set(self, n: int, raw: float, kind: int) -> bool:
        """Set the parameter in place ``n`` as PARAM_SET has it; whether that changed anything.

        Raises
        ------
        RefusedError
            With the reason; the value in force stays.
        """
        parameter = self._all[n]
        if kind != (_INTEGER if parameter.integer else _FLOAT):
            raise RefusedError(f"{parameter.name} is {'an integer' if parameter.integer else 'a float'}")
        value = float(struct.unpack("<i", struct.pack("<f", raw))[0]) if parameter.integer else as_typed(raw)
        if not math.isfinite(value):
            raise RefusedError(f"{parameter.name}: must be a finite number")
        if not parameter.low <= value <= parameter.high:
            raise RefusedError(f"{parameter.name} {value:.10g}: {parameter.low:.10g} to {parameter.high:.10g}")
        before = parameter.read()
        if value == before or (not parameter.integer and np.float32(value) == np.float32(before)):
            return False
        parameter.write(value)
        return True


def _attribute(view: AutopilotView, name: str, parameter: str, low: float, high: float, meaning: str) -> Parameter:
    return Parameter(
        parameter,
        lambda: float(getattr(view, name)),
        lambda value: setattr(view, name, int(value)),
        low,
        high,
        True,
        meaning,
    )


def _system(view: AutopilotView) -> Iterator[Parameter]:
    yield _attribute(view, "failures_enabled", "SYS_FAILURE_EN", 0, 1, "1: failures may be injected")
    yield Parameter(
        "COM_OF_LOSS_T",
        lambda: view.offboard_timeout,
        lambda value: setattr(view, "offboard_timeout", value),
        0.0,
        60.0,
        meaning="simulated time without targets after which offboard becomes hold, s, 0: never",
    )
    yield Parameter(
        "MIS_TAKEOFF_ALT",
        lambda: view.takeoff_altitude,
        lambda value: setattr(view, "takeoff_altitude", value),
        0.0,
        1e5,
        meaning="m, kept for clients that set it before a take-off, which does nothing in the air",
    )
    yield _attribute(view, "at_ms", "FTCC_AT", 0, 2**31 - 1, "simulated ms at which failures act, 0: at once")


_SET_UP = {
    "SYS_AUTOSTART": (2100.0, "an airframe is chosen: PX4's number of a plain aeroplane"),
    "COM_RC_IN_MODE": (1.0, "there is no radio control"),
    "CAL_GYRO0_ID": (1.0, "the gyroscopes are calibrated"),
    "CAL_ACC0_ID": (1.0, "the accelerometers are"),
    "CAL_MAG0_ID": (1.0, "the compass is"),
    "SYS_HAS_NUM_ASPD": (0.0, "no airspeed sensor is to be calibrated"),
    "CBRK_AIRSPD_CHK": (162128.0, "it needs no check"),
}
"""What a ground station of PX4 wants to know before it calls an aircraft set up; nothing here can be changed."""


def _set_up() -> Iterator[Parameter]:
    def fixed(name: str, value: float, meaning: str) -> Parameter:
        def write(_: float) -> None:
            raise RefusedError(f"{name}: nothing to set up here")

        return Parameter(name, lambda: value, write, value, value, True, meaning)

    return (fixed(name, *rest) for name, rest in _SET_UP.items())


def _sizes(sizes: dict[str, float], known: Iterable[Size]) -> Iterator[Parameter]:
    """Sizes of failures, or of lies."""

    def one(size: Size) -> Parameter:
        def write(value: float) -> None:
            sizes[size.name] = value

        meaning = f"{size.meaning}, {size.unit}"
        return Parameter(size.name, lambda: sizes[size.name], write, size.low, size.high, size.integer, meaning)

    return map(one, known)


def _channel(view: AutopilotView) -> Iterator[Parameter]:
    if not view.spec.neighbours:
        return
    timing = view.setting.timing

    def one(name: str, field: str, high: float, meaning: str) -> Parameter:
        def write(value: float) -> None:
            asked = view.channel._replace(**{field: value})
            total = timing.latency_us / 1e6 + asked.delay + asked.jitter
            if total > _MOST_PERIODS * timing.exchange_us / 1e6:
                raise RefusedError(f"{name} {value:g}: {total:g} s is over {_MOST_PERIODS} exchange periods")
            view.channel = asked
            view.inbox.quality[view.i, : view.inbox.degree[view.i], Channel._fields.index(field)] = value

        return Parameter(name, lambda: float(getattr(view.channel, field)), write, 0.0, high, meaning=meaning)

    for name, (field, high, meaning) in _CHANNEL.items():
        yield one(name, field, high, meaning)


def _fire(view: AutopilotView) -> Iterator[Parameter]:
    """Where the fire is and where it drifts, from FTCC_AT on: to be set at all UAVs for the same time."""
    if view.scheme.plant != "position":
        return
    commands = view.autopilots.reference_commands[view.i]
    limit = Fire(*view.spec.reference.parameters).shift_speed

    def one(name: str, field: str, most: float, meaning: str) -> Parameter:
        def write(value: float) -> None:
            at_us = view.at_ms * 1000 or view.next_us
            if at_us < view.next_us:
                raise RefusedError(f"{name}: FTCC_AT {view.at_ms} ms is past")
            if not change_from_ground(commands, view.now_us / 1e6, at_us / 1e6, field, value):
                raise RefusedError(f"{name}: a change of the fire at another time is waiting")

        return Parameter(name, lambda: float(getattr(newest(commands), field)), write, -most, most, meaning=meaning)

    yield one("FIRE_NORTH", "north", 1e5, "centre of the fire at the time of its change, m north")
    yield one("FIRE_EAST", "east", 1e5, "m east")
    yield one("FIRE_DRIFT_N", "drift_north", 0.99 * limit, "its drift, m/s north")
    yield one("FIRE_DRIFT_E", "drift_east", 0.99 * limit, "m/s east")


def _rates(view: AutopilotView, telemetry: Telemetry) -> Iterator[Parameter]:
    def one(n: int, name: str) -> Parameter:
        def write(value: float) -> None:
            if 0.0 < value < SLOWEST:
                raise RefusedError(f"SR_{name} {value:g}: 0, or at least {SLOWEST:g} Hz")
            telemetry.set_default_rate(n, value)

        return Parameter(f"SR_{name}", lambda: telemetry.default_rate(n), write, 0.0, 1000.0, meaning="Hz, 0: silent")

    return (one(n, stream.name) for n, stream in enumerate(STREAMS) if stream.known_to(view))


def _gains(view: AutopilotView) -> Iterator[Parameter]:
    """The scheme's gains. MAVProxy knows names in capitals only: so they are announced, in so far as they differ."""
    if view.leader:
        return
    names = view.scheme.gains_type._fields
    switch = view.scheme.switches.get(FAULT_TOLERANCE, {})
    given = dict(zip(names, view.spec.tolerant_gains or view.spec.gains, strict=True))
    """Gains with fault tolerance on."""

    def bring_into_force(gains: dict[str, float], tolerant: bool) -> None:
        in_force = view.scheme.gains_type(**(gains | ({} if tolerant else switch)))
        if view.spec.flight is not None:
            fatal = [p.text for p in view.scheme.check(in_force, view.spec.flight) if p.fatal]
            if fatal:
                raise RefusedError(fatal[0])
        view.autopilots.gains[view.i] = in_force

    ranges = view.scheme.ranges

    def gain(name: str, announced: str, meaning: str) -> Parameter:
        least, most = (ranges[name].least, ranges[name].most) if name in ranges else (-_ANY, _ANY)

        def write(value: float) -> None:
            bring_into_force(given | {name: value}, view.fault_tolerance)
            given[name] = value

        return Parameter(announced, lambda: given[name], write, max(least, -_ANY), min(most, _ANY), meaning=meaning)

    capitals = [name.upper() for name in names]
    for name, note in quantities(view.scheme.gains_type).items():
        announced = name.upper() if capitals.count(name.upper()) == 1 else name
        yield gain(name, announced, f"{note.meaning}, {note.unit}")

    if switch:
        view.fault_tolerance = not view.spec.tolerant_gains

        def set_tolerance(value: float) -> None:
            bring_into_force(given, bool(value))
            view.fault_tolerance = bool(value)

        yield Parameter(
            "FTCC_FT", lambda: float(view.fault_tolerance), set_tolerance, 0, 1, True, "1: fault tolerance on"
        )


_SHORT = {
    "effectiveness": "eff",
    "coefficient": "coef",
    "frequency": "freq",
    "elevator": "ele",
    "aileron": "ail",
    "rudder": "rud",
    "thrust": "thr",
    "load_factor": "load",
}
"""Words of settings that are shortened in their parameters, whose names have at most 16 characters."""
_OF_LEADERS = ("fresh", "silent", "room", "room_pace")
"""Settings that a leader makes room by."""


def diagnosis_parameter(setting: str) -> str:
    """Name of the parameter of a setting of diagnosis: ``FDI_DRIFT_ELE`` for ``drift_elevator``."""
    for word, short in _SHORT.items():
        setting = setting.replace(word, short)
    return f"FDI_{setting.upper()}"


def defence_parameter(setting: str) -> str:
    """Name of the parameter of a setting of the defences: ``DEF_JUMP_SPEED`` for ``jump_speed``."""
    return f"DEF_{setting.upper()}"


def _diagnosis(view: AutopilotView) -> Iterator[Parameter]:
    """Settings of fault detection and isolation, and of making room, where the swarm diagnoses its faults."""
    diagnosis = view.autopilots.diagnosis
    if diagnosis is None:
        return
    names = [name for name in DiagnosisGains._fields if name in _OF_LEADERS or not view.leader]
    yield from _settings(DiagnosisGains, DIAGNOSIS_RANGES, diagnosis.gains[view.i], names, diagnosis_parameter)


def _defence(view: AutopilotView) -> Iterator[Parameter]:
    """Settings of the defences, where the swarm has any."""
    if view.defended:
        gains = view.autopilots.defence.gains[view.i]
        yield from _settings(DefenceGains, DEFENCE_RANGES, gains, DefenceGains._fields, defence_parameter)


def _settings(
    record: Any,
    allowed_values: Mapping[Range, str],
    in_force: NDArray[np.float64],
    names: Sequence[str],
    announced_as: Callable[[str], str],
) -> Iterator[Parameter]:
    """Settings that stand in ``in_force`` in the order of ``record``."""
    ranges = {name: allowed for allowed, names in allowed_values.items() for name in names.split()}

    def one(n: int, name: str, note: Quantity) -> Parameter:
        announced, allowed = announced_as(name), ranges[name]

        def write(value: float) -> None:
            if refusal := allowed.refusal(value):
                raise RefusedError(f"{announced} {value:g}: {refusal}")
            in_force[n] = value

        def read() -> float:
            return float(in_force[n])

        return Parameter(
            announced, read, write, allowed.least, min(allowed.most, _ANY), meaning=f"{note.meaning}, {note.unit}"
        )

    for n, (name, note) in enumerate(quantities(record).items()):
        if name in names:
            yield one(n, name, note)
