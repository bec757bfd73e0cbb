"""Failures: the one table of what MAV_CMD_INJECT_FAILURE can ask for, by unit, instance and type.

Both processes of a UAV read it: the autopilot answers the ground station and makes link events of radio failures, the
vehicle makes faults of the others.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from ftcc.link.mavlink import AUTOPILOT, SIMULATOR, as_typed, dialect, float_array

__all__ = [
    "AIRFRAME_SIZES",
    "EVERY",
    "FAILURES",
    "KINDS",
    "LINK_SIZES",
    "SIZES",
    "UNITS",
    "Failure",
    "Meaning",
    "Size",
    "Unit",
    "failure_answer",
    "failure_messages",
    "meaning_of",
    "parts_of",
    "read_failure",
]

KINDS = {
    "ok": dialect.FAILURE_TYPE_OK,
    "off": dialect.FAILURE_TYPE_OFF,
    "stuck": dialect.FAILURE_TYPE_STUCK,
    "wrong": dialect.FAILURE_TYPE_WRONG,
    "slow": dialect.FAILURE_TYPE_SLOW,
    "delayed": dialect.FAILURE_TYPE_DELAYED,
    "intermittent": dialect.FAILURE_TYPE_INTERMITTENT,
}
"""Kinds of failure by our names."""

EVERY = 0
"""The instance that stands for all of a unit."""


class Size(NamedTuple):
    """A parameter of the UAV that gives the size of failures."""

    name: str
    default: float
    low: float
    high: float
    unit: str
    meaning: str
    scenario_name: str = ""
    """What scenarios and Python call it, where that is more than the name without FAIL_ in small letters."""
    integer: bool = False

    @property
    def keyword(self) -> str:
        """What Python calls it: the `scenario_name`, or the name without FAIL_ in small letters."""
        return self.scenario_name or self.name.removeprefix("FAIL_").lower()


_ANY = 1e6
_SIZES_ARRAY = "failure"
"""Name of the DEBUG_FLOAT_ARRAY in which an autopilot sends its vehicle the sizes."""

AIRFRAME_SIZES = (
    Size("FAIL_EFF", 0.5, 0.0, 1.0, "-", "remaining effectiveness of an actuator", "effectiveness"),
    Size("FAIL_BIAS", 0.0, -_ANY, _ANY, "rad or N", "bias of an actuator"),
    Size("FAIL_EFF_RATE", 0.0, 0.0, 1e3, "1/s", "exponential onset of the loss, 0 = step", "effectiveness_onset"),
    Size("FAIL_BIAS_RATE", 0.0, 0.0, 1e3, "1/s", "exponential onset of the bias, 0 = step", "bias_onset"),
    Size("FAIL_SLEW", 0.1, 1e-6, _ANY, "rad/s or N/s", "largest rate of a slow actuator"),
    Size("FAIL_PERIOD", 1.0, 1e-3, 1e4, "s", "period of an intermittent failure, of a slow solution's updates"),
    Size("FAIL_DUTY", 0.5, 0.0, 1.0, "-", "healthy share of that period"),
    Size("FAIL_POS_N", 0.0, -_ANY, _ANY, "m", "wrong position, north"),
    Size("FAIL_POS_E", 0.0, -_ANY, _ANY, "m", "wrong position, east"),
    Size("FAIL_POS_D", 0.0, -_ANY, _ANY, "m", "wrong position, down"),
    Size("FAIL_VEL_N", 0.0, -1e3, 1e3, "m/s", "wrong velocity, north"),
    Size("FAIL_VEL_E", 0.0, -1e3, 1e3, "m/s", "wrong velocity, east"),
    Size("FAIL_VEL_D", 0.0, -1e3, 1e3, "m/s", "wrong velocity, down"),
    Size("FAIL_ROLL", 0.0, -3.2, 3.2, "rad", "wrong roll angle"),
    Size("FAIL_PITCH", 0.0, -1.6, 1.6, "rad", "wrong pitch angle"),
    Size("FAIL_YAW", 0.0, -3.2, 3.2, "rad", "wrong yaw angle"),
    Size("FAIL_P", 0.0, -1e2, 1e2, "rad/s", "wrong roll rate"),
    Size("FAIL_Q", 0.0, -1e2, 1e2, "rad/s", "wrong pitch rate"),
    Size("FAIL_R", 0.0, -1e2, 1e2, "rad/s", "wrong yaw rate"),
)
"""In the order in which the autopilot sends them to its vehicle."""

LINK_SIZES = (
    Size("FAIL_LOSS", 0.3, 0.0, 1.0, "-", "probability that a record is lost"),
    Size("FAIL_BURST_S", 0.0, 0.0, 1.0, "-", "probability per record of entering a burst of losses"),
    Size("FAIL_BURST_E", 1.0, 0.0, 1.0, "-", "probability per record of leaving it"),
    Size("FAIL_BURST_L", 1.0, 0.0, 1.0, "-", "probability of loss within a burst"),
    Size("FAIL_DELAY", 0.1, 0.0, 1e2, "s", "delay beyond the link latency"),
    Size("FAIL_JITTER", 0.1, 0.0, 1e2, "s", "further delay, uniform in [0, jitter]"),
)
"""The columns of ``channel.Channel`` except ``blocked``, in their order."""

SIZES = (*AIRFRAME_SIZES, *LINK_SIZES)


def parameter_of(keyword: str) -> str:
    """The parameter that a size is called by its keyword, or by its MAVLink name in small letters.

    Raises
    ------
    LookupError
        If there is no such size; the text names those that there are.
    """
    for size in SIZES:
        if keyword in (size.keyword, size.name.removeprefix("FAIL_").lower()):
            return size.name
    raise LookupError(f"{keyword}: no such size; there are {', '.join(size.keyword for size in SIZES)}")


@dataclass(frozen=True)
class Unit:
    """Something that can fail."""

    name: str
    """In MAVLink, without FAILURE_UNIT_."""
    code: int
    instances: str
    """Which instances there are, a text for people."""
    highest: int
    """Largest instance; 0 stands for all of them."""
    on_board: bool
    """True: a failure of the airframe, which the vehicle answers. False: of the radio, which the autopilot answers."""
    parts: tuple[str, ...] = ()
    """Actuators; the first one is instance 1."""
    all_parts: str = ""
    """Name of instance 0."""


_SURFACES = ("aileron", "elevator", "rudder")
_SERVO = Unit(
    "SYSTEM_SERVO",
    dialect.FAILURE_UNIT_SYSTEM_SERVO,
    "1 aileron, 2 elevator, 3 rudder; 0 all",
    3,
    True,
    _SURFACES,
    "surfaces",
)
_MOTOR = Unit("SYSTEM_MOTOR", dialect.FAILURE_UNIT_SYSTEM_MOTOR, "1 thrust", 1, True, ("thrust",), "thrust")
_GPS = Unit("SENSOR_GPS", dialect.FAILURE_UNIT_SENSOR_GPS, "0 or 1: position and velocity", 1, True, (), "position")
_GYRO = Unit("SENSOR_GYRO", dialect.FAILURE_UNIT_SENSOR_GYRO, "0 or 1: attitude and rates", 1, True, (), "attitude")
_RADIO = Unit(
    "SYSTEM_MAVLINK_SIGNAL",
    dialect.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL,
    "0 own radio; n the edge from UAV n",
    200,
    False,
)

UNITS = {"servo": _SERVO, "motor": _MOTOR, "gps": _GPS, "gyro": _GYRO, "radio": _RADIO}
"""Units by our names."""


def parts_of(unit: Unit, actuators: Collection[str]) -> dict[int, str]:
    """The instances of a ``unit`` that aircraft with these ``actuators`` have, number and name.

    An actuator in the slot of a surface counts as that surface. Empty for a unit without actuators.
    """
    # It loads numba, which a program that only asks for a failure does not need.
    from ftcc.link.actuators import SLOT

    named = {SLOT[actuator]: actuator for actuator in actuators}
    return {n: named[SLOT[part]] for n, part in enumerate(unit.parts, 1) if SLOT[part] in named}


class Meaning(NamedTuple):
    """What one kind of failure does to a unit."""

    unit: Unit
    kind: str
    text: str
    sizes: tuple[str, ...] = ()
    """Parameters that give its size."""


_ACTUATOR: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "wrong": (
        "acts as effectiveness * position + bias",
        ("FAIL_EFF", "FAIL_BIAS", "FAIL_EFF_RATE", "FAIL_BIAS_RATE"),
    ),
    "off": ("effectiveness 0", ()),
    "stuck": ("holds the deflection that it has", ()),
    "slow": ("moves no faster than a limit", ("FAIL_SLEW",)),
    "intermittent": (
        "healthy for a share of each period, else as wrong",
        ("FAIL_PERIOD", "FAIL_DUTY", "FAIL_EFF", "FAIL_BIAS"),
    ),
    "ok": ("repaired", ()),
}
_POSITION: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "wrong": (
        "position and velocity with an offset",
        ("FAIL_POS_N", "FAIL_POS_E", "FAIL_POS_D", "FAIL_VEL_N", "FAIL_VEL_E", "FAIL_VEL_D"),
    ),
    "off": ("dead reckoning: the velocity is held, the position moves with it", ()),
    "stuck": ("position and velocity are held", ()),
    "slow": ("updated once in a period, held in between", ("FAIL_PERIOD",)),
    "intermittent": ("right for a share of each period, held for the rest", ("FAIL_PERIOD", "FAIL_DUTY")),
    "ok": ("repaired", ()),
}
_ATTITUDE: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "wrong": (
        "attitude and rates with an offset",
        ("FAIL_ROLL", "FAIL_PITCH", "FAIL_YAW", "FAIL_P", "FAIL_Q", "FAIL_R"),
    ),
    "off": ("rates read zero, the attitude is held", ()),
    "stuck": ("attitude and rates are held", ()),
    "slow": ("updated once in a period, held in between", ("FAIL_PERIOD",)),
    "intermittent": ("right for a share of each period, held for the rest", ("FAIL_PERIOD", "FAIL_DUTY")),
    "ok": ("repaired", ()),
}
_LINK: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "off": ("cut; the own radio in both directions", ()),
    "intermittent": ("records are lost", ("FAIL_LOSS", "FAIL_BURST_S", "FAIL_BURST_E", "FAIL_BURST_L")),
    "delayed": ("records come late", ("FAIL_DELAY",)),
    "slow": ("records come late by a random time", ("FAIL_JITTER",)),
    "wrong": ("what is told is false: a lie as ATK_* say, see `ftcc attacks`", ()),
    "ok": ("restored", ()),
}

_WHAT_FAILS = ((_SERVO, _ACTUATOR), (_MOTOR, _ACTUATOR), (_GPS, _POSITION), (_GYRO, _ATTITUDE), (_RADIO, _LINK))

FAILURES = tuple(
    Meaning(unit, kind, text, sizes) for unit, kinds in _WHAT_FAILS for kind, (text, sizes) in kinds.items()
)
"""Everything that MAV_CMD_INJECT_FAILURE can ask for; anything else is unsupported."""

_BY_CODES = {(meaning.unit.code, KINDS[meaning.kind]): meaning for meaning in FAILURES}


def meaning_of(unit: float, kind: float, instance: float) -> Meaning | None:
    """The meaning of the first three parameters of MAV_CMD_INJECT_FAILURE; None where it is unsupported."""
    if not all(number == number // 1 for number in (unit, kind, instance)):
        return None  # also where one of them is nan
    meaning = _BY_CODES.get((int(unit), int(kind)))
    return meaning if meaning is not None and 0 <= instance <= meaning.unit.highest else None


@dataclass(frozen=True)
class Failure:
    """A failure of the airframe, as commanded."""

    meaning: Meaning
    instance: int
    sizes: Mapping[str, float]
    """By the names of `AIRFRAME_SIZES`."""


def failure_messages(uav: int, meaning: Meaning, instance: int, at_us: int, sizes: Sequence[float]) -> tuple[Any, Any]:
    """The two messages of an autopilot to its vehicle: sizes and simulated time (us; 0 = at once), then the command."""
    sizes_array = float_array(at_us, _SIZES_ARRAY, sizes)
    command = dialect.MAVLink_command_long_message(
        uav,
        SIMULATOR,
        dialect.MAV_CMD_INJECT_FAILURE,
        0,
        meaning.unit.code,
        KINDS[meaning.kind],
        instance,
        0.0,
        0.0,
        0.0,
        0.0,
    )
    return sizes_array, command


def read_failure(messages: Sequence[Any]) -> tuple[Failure | None, int]:
    """The inverse of `failure_messages`, from the beginning of ``messages``: the failure, and its time in us."""
    if len(messages) < 2:
        return None, 0
    sizes_array, command = messages[0], messages[1]
    if sizes_array.get_type() != "DEBUG_FLOAT_ARRAY" or command.get_type() != "COMMAND_LONG":
        return None, 0
    meaning = meaning_of(command.param1, command.param2, command.param3)
    if (
        sizes_array.name.rstrip("\0") != _SIZES_ARRAY
        or command.command != dialect.MAV_CMD_INJECT_FAILURE
        or meaning is None
    ):
        return None, 0
    names = [size.name for size in AIRFRAME_SIZES]
    sizes = dict(zip(names, map(as_typed, sizes_array.data), strict=False))
    return Failure(meaning, int(command.param3), sizes), int(sizes_array.time_usec)


def failure_answer(uav: int, result: int, at_us: int) -> Any:
    """COMMAND_ACK of a vehicle to its autopilot, with the simulated time at which the failure acts, in ms."""
    command = dialect.MAV_CMD_INJECT_FAILURE
    return dialect.MAVLink_command_ack_message(command, result, 0, at_us // 1000, uav, AUTOPILOT)
