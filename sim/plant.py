"""What all vehicles have in common, whatever plant they fly: their arrays, actuators with faults, disturbances.

Everything a vehicle is made of stands in plain arrays, so that one compiled function flies it in the vehicle process
and in the single-process simulation. The equations of motion are those of a module of `plants`, integrated by `cycle`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import THRUST
from ftcc.link.compiled import compiled, compiled_within, copy, fill
from ftcc.link.events import EventList
from ftcc.link.philox import GUST, gaussian_pair, philox

__all__ = [
    "DIVERGED",
    "INTERMITTENT",
    "LOST",
    "STUCK",
    "TRUTH",
    "UNITS",
    "WRONG",
    "Autothrottle",
    "Disturbance",
    "Fault",
    "Fleet",
    "Guards",
    "Gust",
    "actuate",
    "disturb",
    "fault",
    "gust",
    "healthy",
    "hold_speed",
    "latch",
    "stroke",
]

TRUTH = ("x", "y", "z", "V", "gamma", "chi", "mu", "alpha", "beta", "theta", "p", "q", "r")
"""Order of the truth vector: altitude z up, angles rad, rates rad/s."""

UNITS = dict(zip(TRUTH, ("m", "m", "m", "m/s") + ("rad",) * 6 + ("rad/s",) * 3, strict=True))

X, Y, Z, V, GAMMA, CHI, MU, ALPHA, BETA, THETA, P, Q, R = range(13)

DIVERGED = 5
"""Key of `LOST`: the law's command is not finite."""

AIRSPEED, CLIMB, INCIDENCE, NUMBER, SIDESLIP = 1, 2, 3, 4, 6
"""Keys of `LOST` that a plant's ``lost`` returns."""

LOST = {
    0: "",
    AIRSPEED: "airspeed left the model",
    CLIMB: "flight-path angle left the model",
    INCIDENCE: "angle of attack left the model",
    NUMBER: "state is not a number",
    DIVERGED: "control law gave a command that is not a number",
    SIDESLIP: "sideslip left the model",
}
"""Why a vehicle ended, by code."""


class Guards(NamedTuple):
    """Columns of ``Fleet.guards``: beyond these a vehicle is lost."""

    least_airspeed: float
    """m/s."""
    flight_path_angle: float
    """rad."""
    angle_of_attack: float
    """rad."""
    sideslip: float
    """rad."""


_ROUNDING = 1e-9
"""By how much a time may be short of the phase that it belongs to, s."""

WRONG, STUCK, INTERMITTENT = range(3)
"""Kinds of `Fault`."""


class Fault(NamedTuple):
    """Columns of ``Fleet.faults``: from ``time`` on, the actuator acts as effectiveness * position + bias.

    Stuck it holds the deflection that it has; intermittent it is healthy for a share of each period.
    """

    time: float
    """s."""
    actuator: float
    """Its slot, see ``link.actuators.SLOT``."""
    effectiveness: float
    bias: float
    """In the unit of the actuator."""
    effectiveness_onset: float
    """Rate of the exponential onset of the loss, 1/s; 0 = step."""
    bias_onset: float
    """Rate of the exponential onset of the bias, 1/s; 0 = step."""
    kind: float = WRONG
    slew: float = math.inf
    """Fastest motion, rad/s or N/s; inf = as ever."""
    period: float = 1.0
    """Of an intermittent fault, s."""
    duty: float = 1.0
    """Its healthy share."""


class Disturbance(NamedTuple):
    """Columns of ``Fleet.disturbances``."""

    time: float
    """s."""
    channel: float
    """Index into the plant's ``DISTURBANCES``."""
    value: float
    """Constant value, or amplitude, in the channel's unit."""
    onset: float
    """Rate of the exponential onset, 1/s; 0 = step."""
    until: float = math.inf
    """When it ends, as a step, s."""
    frequency: float = 0.0
    """Of value * sin(frequency * (t - time) + phase), rad/s; 0 = constant."""
    phase: float = 0.0
    """rad."""


class Autothrottle(NamedTuple):
    """The vehicle's own speed hold, in place of the commanded thrust: thrust + gain (airspeed - V) within limits."""

    gain: float
    """N per m/s; 0 = none."""
    airspeed: float
    """m/s."""
    thrust: float
    """N."""


class Gust(NamedTuple):
    """Turbulence along the track: a normal number that is drawn anew and held, each vehicle its own."""

    deviation: float = 0.0
    """m/s."""
    period_us: int = 100_000
    seed: int = 0


class Fleet(NamedTuple):
    """The k vehicles of a process, a row each. Actuators stand in their slots, see ``link.actuators.SLOT``."""

    state: NDArray[np.float64]
    """(k, n): the plant's ``State``."""
    position: NDArray[np.float64]
    """(k, 4): actuator positions behind the lag."""
    command: NDArray[np.float64]
    """(k, 4): the command in force, as received."""
    acting: NDArray[np.float64]
    """(k, 4): what acts on the airframe."""
    limits: NDArray[np.float64]
    """(k, 4, 2): lower and upper limit of the command."""
    lag: NDArray[np.float64]
    """(k, 4): actuator bandwidth, rad/s; 0 = none."""
    rate: NDArray[np.float64]
    """(k, 4): fastest motion of the actuator, rad/s or N/s; inf = no limit."""
    damping: NDArray[np.float64]
    """(k, 4): 0 = first order; else the damping, below 1, of a second-order actuator whose frequency is ``lag``."""
    speed: NDArray[np.float64]
    """(k, 4): rate of the position of second-order actuators."""
    delayed: NDArray[np.float64]
    """(k, d, 4): commands that wait for ``d`` further samples before they are in force, the oldest first."""
    waiting: NDArray[np.int64]
    """(k,): 1 once the line holds commands: from the first one on, or from the start."""
    fault_before_lag: NDArray[np.float64]
    """(k,): 1 where a fault acts at the input of the lag, 0 where it acts on the position behind it."""
    faults: NDArray[np.float64]
    """(k, n, 10): see `Fault`, in order of time; unused rows have time inf."""
    fault_count: NDArray[np.int64]
    """(k,): rows in use."""
    deflection: NDArray[np.float64]
    """(k, 4): what acted last."""
    held: NDArray[np.float64]
    """(k, 4): what a stuck actuator holds."""
    held_since: NDArray[np.float64]
    """(k, 4): time of the fault by which it is stuck, s; inf = it is not."""
    navigation: NDArray[np.float64]
    """(k, n, 11): see ``navigation.NavigationFault``, in order of time; unused rows have time inf."""
    navigation_count: NDArray[np.int64]
    """(k,): rows in use."""
    solution: NDArray[np.float64]
    """(k, 13): the last fresh navigation solution, as its messages carry it."""
    fresh: NDArray[np.float64]
    """(k, 2): time of the last fresh position and attitude, s; -1 = there was none."""
    updates: NDArray[np.int64]
    """(k, 2): updates of a slow solution that are past."""
    disturbances: NDArray[np.float64]
    """(k, n, 7): see `Disturbance`; unused rows have time inf."""
    code: NDArray[np.float64]
    """(k, 3): see `AttitudeCode`."""
    gust_deviation: NDArray[np.float64]
    """(k,): see `Gust`."""
    gust_period_us: NDArray[np.int64]
    """(k,)."""
    gust_seed: NDArray[np.int64]
    """(k,)."""
    gusts: NDArray[np.float64]
    """(k, n, 6): see ``wind.DiscreteGust``; unused rows have time inf."""
    dryden: NDArray[np.float64]
    """(k, 3, 6): see ``wind.dryden``; zeros without turbulence."""
    turbulence: NDArray[np.float64]
    """(k, 3, 2): the states of its filters."""
    turbulence_seed: NDArray[np.int64]
    """(k,)."""
    still: NDArray[np.int64]
    """(k,): 1 where there are neither gusts nor turbulence: the air's motion stays 0."""
    guards: NDArray[np.float64]
    """(k, 4): see `Guards`."""
    airframe: NDArray[np.float64]
    """(k, m): the plant's ``Parameters``."""
    datum: NDArray[np.float64]
    """(k,): altitude from which that in the state's message counts, m: a float32 is fine near its zero alone."""
    offset: NDArray[np.float64]
    """(k,): lateral position y of a plant that flies in a vertical plane, m."""
    target: NDArray[np.float64]
    """(k, 7): where the vehicle is a `reference_point`: the target in force (stamp s, x, y, z, vx, vy, vz), z up."""
    point: NDArray[np.int64]
    """(k,): 1 for a `reference_point`."""
    noise: NDArray[np.float64]
    """(k, 13): standard deviation of each measured channel, order of `TRUTH`."""
    uav: NDArray[np.int64]
    """(k,): ids."""
    travel: NDArray[np.float64]
    """(k, 4): full deflection of each actuator."""
    zones: NDArray[np.float64]
    """(n, 3): the obstacles, see `obstacles.Obstacle`."""
    entered: NDArray[np.int64]
    """(k, n): 1 once a vehicle has entered the zone."""
    events: EventList
    """What is to be told; the kinds are those of `obstacles`."""
    autothrottle: NDArray[np.float64]
    """(k, 4): see `Autothrottle`, then the thrust that it asks for at present, N."""
    disturbed: NDArray[np.float64]
    """(k, d): room for the disturbances of a step."""


@compiled_within
def _onset(since: float, rate: float) -> float:
    return 1.0 if rate == 0.0 else 1.0 - math.exp(-rate * since)


@compiled_within
def healthy(since, period, duty):
    """Whether what fails now and then is right at ``since`` (s) after its failure began."""
    return (since + _ROUNDING) % period < duty * period


@compiled
def fault(fleet, i, actuator, time):
    """Effectiveness, bias and largest rate of an actuator: those of its latest fault."""
    latest = -1
    for n in range(fleet.fault_count[i]):
        if time - fleet.faults[i, n, 0] >= 0.0 and int(fleet.faults[i, n, 1]) == actuator:
            latest = n
    if latest < 0:
        return 1.0, 0.0, fleet.rate[i, actuator]
    row = fleet.faults[i, latest]
    since = time - row[0]
    kind = int(row[6])
    if kind == STUCK:
        if fleet.held_since[i, actuator] != row[0]:
            fleet.held_since[i, actuator] = row[0]
            fleet.held[i, actuator] = fleet.deflection[i, actuator]
        return 0.0, fleet.held[i, actuator], fleet.rate[i, actuator]
    fleet.held_since[i, actuator] = math.inf
    if kind == INTERMITTENT and healthy(since, row[8], row[9]):
        return 1.0, 0.0, fleet.rate[i, actuator]
    effectiveness = 1.0 + (row[2] - 1.0) * _onset(since, row[4])
    bias = row[3] * _onset(since, row[5])
    return effectiveness, bias, min(fleet.rate[i, actuator], row[7])


@compiled
def disturb(fleet, i, time, out):
    """Write into ``out`` (d,) what disturbs vehicle ``i`` at ``time`` (s), summed by channel."""
    fill(out, 0.0)
    for n in range(fleet.disturbances.shape[1]):
        row = fleet.disturbances[i, n]
        since = time - row[0]
        if since >= 0.0 and time < row[4]:
            swing = math.sin(row[5] * since + row[6]) if row[5] > 0.0 else 1.0
            out[int(row[1])] += row[2] * _onset(since, row[3]) * swing


@compiled
def gust(fleet, i, time):
    """Gust (m/s) on vehicle ``i`` at ``time`` (s), eq. (9.33)."""
    if fleet.gust_deviation[i] == 0.0:
        return 0.0
    draw = int(time * 1e6) // fleet.gust_period_us[i]
    u, v, _, _ = philox(fleet.gust_seed[i], draw & 0xFFFFFFFF, fleet.uav[i], GUST, 0)
    first, _ = gaussian_pair(u, v)
    return fleet.gust_deviation[i] * first


@compiled
def latch(fleet, i, command):
    """Bring ``command`` (4,) into force, or the one that came before it by the vehicle's delay.

    The first one counts as all that came before it, unless the line holds commands from the start.
    """
    line = fleet.delayed[i]
    last = line.shape[0] - 1
    if last < 0:
        copy(command, fleet.command[i])
        return
    if fleet.waiting[i] == 0:
        for n in range(last + 1):
            copy(command, line[n])
        fleet.waiting[i] = 1
    copy(line[0], fleet.command[i])
    for n in range(last):
        copy(line[n + 1], line[n])
    copy(command, line[last])


@compiled_within
def _saturated(fleet, i, actuator):
    asked = fleet.command[i, actuator]
    if actuator == THRUST and fleet.autothrottle[i, 0] > 0.0:
        asked = fleet.autothrottle[i, 3]
    return min(max(asked, fleet.limits[i, actuator, 0]), fleet.limits[i, actuator, 1])


@compiled_within
def hold_speed(fleet, i, airspeed):
    """Set the thrust that the autothrottle of vehicle ``i`` asks for at this airspeed (m/s)."""
    gain, wanted, thrust = fleet.autothrottle[i, 0], fleet.autothrottle[i, 1], fleet.autothrottle[i, 2]
    fleet.autothrottle[i, 3] = thrust + gain * (wanted - airspeed)


@compiled_within
def _immediate(fleet, i, actuator, rate):
    return fleet.lag[i, actuator] == 0.0 and rate == math.inf


@compiled
def actuate(fleet, i, time):
    """Set what acts on vehicle ``i`` at ``time`` (s) under the command in force."""
    for actuator in range(4):
        effectiveness, bias, rate = fault(fleet, i, actuator, time)
        if _immediate(fleet, i, actuator, rate):
            fleet.position[i, actuator] = _saturated(fleet, i, actuator)
        elif fleet.fault_before_lag[i] > 0.0:
            effectiveness, bias = 1.0, 0.0
        fleet.acting[i, actuator] = effectiveness * fleet.position[i, actuator] + bias
        fleet.deflection[i, actuator] = fleet.acting[i, actuator]


@compiled
def _moved(before, target, lag, rate, since):
    """Position ``since`` s after ``before`` on the way to ``target``: pos' = lag (target - pos), at most ``rate``."""
    away = abs(target - before)
    if lag * away <= rate and lag > 0.0:
        return target + (before - target) * math.exp(-lag * since)
    slowing = rate / lag if lag > 0.0 else 0.0
    until = (away - slowing) / rate
    direction = 1.0 if target > before else -1.0
    if since < until:
        return before + direction * rate * since
    return target - direction * slowing * math.exp(-lag * (since - until))


@compiled
def _swung(before, speed, target, frequency, damping, since):
    """Position and rate of a second-order actuator ``since`` s after ``before`` and ``speed``, exactly."""
    decay, beat = damping * frequency, frequency * math.sqrt(1.0 - damping * damping)
    offset = before - target
    lead = (speed + decay * offset) / beat
    shrunk, cosine, sine = math.exp(-decay * since), math.cos(beat * since), math.sin(beat * since)
    swing = shrunk * (offset * cosine + lead * sine)
    return target + swing, shrunk * beat * (lead * cosine - offset * sine) - decay * swing


@compiled
def stroke(fleet, i, actuator, time, step):
    """Acting deflection at the beginning, middle and end of a ``step`` (s); lag and rate limit are integrated exactly.

    A fault is taken at ``time`` (s), the middle of the step.
    """
    effectiveness, bias, rate = fault(fleet, i, actuator, time)
    target = _saturated(fleet, i, actuator)
    before = fleet.position[i, actuator]
    if _immediate(fleet, i, actuator, rate):
        fleet.position[i, actuator] = target
        deflection = effectiveness * target + bias
        fleet.deflection[i, actuator] = deflection
        return deflection, deflection, deflection
    if fleet.fault_before_lag[i] > 0.0:
        target = effectiveness * target + bias
        effectiveness, bias = 1.0, 0.0
    lag = fleet.lag[i, actuator]
    if fleet.damping[i, actuator] > 0.0 and rate >= fleet.rate[i, actuator]:
        speed, damping = fleet.speed[i, actuator], fleet.damping[i, actuator]
        middle, _ = _swung(before, speed, target, lag, damping, 0.5 * step)
        after, fleet.speed[i, actuator] = _swung(before, speed, target, lag, damping, step)
    else:
        middle = _moved(before, target, lag, rate, 0.5 * step)
        after = _moved(before, target, lag, rate, step)
    fleet.position[i, actuator] = after
    fleet.deflection[i, actuator] = effectiveness * after + bias
    return effectiveness * before + bias, effectiveness * middle + bias, fleet.deflection[i, actuator]
