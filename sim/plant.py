"""The vehicle in flight: actuators with their faults, disturbances, and the longitudinal airframe, in steps of 1 ms.

Everything a vehicle is made of stands in plain arrays, so that one compiled function flies it in the vehicle process
and in the single-process simulation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.link.compiled import compiled, fields
from ftcc.sim.airframe import Airframe, longitudinal_rates

__all__ = [
    "DIVERGED",
    "LOST",
    "TRUTH",
    "UNITS",
    "Disturbance",
    "Fault",
    "Fleet",
    "actuate",
    "advance",
    "effects",
    "truth",
]

TRUTH = ("x", "y", "z", "V", "gamma", "chi", "mu", "alpha", "beta", "theta", "p", "q", "r")
"""Order of the truth vector: altitude z up, angles rad, rates rad/s."""

UNITS = dict(zip(TRUTH, ("m", "m", "m", "m/s") + ("rad",) * 6 + ("rad/s",) * 3, strict=True))

X, Y, Z, V, GAMMA, CHI, MU, ALPHA, BETA, THETA, P, Q, R = range(13)

DIVERGED = 5
"""Key of `LOST`: the law's command is not finite."""

LOST = {
    0: "",
    1: "airspeed left the model",
    2: "flight-path angle left the model",
    3: "angle of attack left the model",
    4: "state is not a number",
    DIVERGED: "control law gave a command that is not a number",
}
"""Why a vehicle ended, by code."""


class Fault(NamedTuple):
    """Columns of ``Fleet.faults``: from ``time`` on, the actuator acts as effectiveness * position + bias."""

    time: float
    """s."""
    actuator: float
    """Index into ``ACTUATORS``."""
    effectiveness: float
    bias: float
    """rad or N."""
    effectiveness_onset: float
    """Rate of the exponential onset of the loss, 1/s; 0 = step."""
    bias_onset: float
    """Rate of the exponential onset of the bias, 1/s; 0 = step."""


class Disturbance(NamedTuple):
    """Columns of ``Fleet.disturbances``."""

    time: float
    """s."""
    channel: float
    """0: airspeed (m/s^2), 1: flight-path angle (rad/s), 2: pitch rate (rad/s^2)."""
    value: float
    onset: float
    """Rate of the exponential onset, 1/s; 0 = step."""


class Fleet(NamedTuple):
    """The k vehicles of a process, a row each. Actuators stand in the order of ``ACTUATORS``."""

    state: NDArray[np.float64]
    """(k, 6): V, x, z, gamma, theta, q."""
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
    fault_before_lag: NDArray[np.float64]
    """(k,): 1 where a fault acts at the input of the lag, 0 where it acts on the position behind it."""
    faults: NDArray[np.float64]
    """(k, n, 6): see `Fault`, in order of time; unused rows have time inf."""
    disturbances: NDArray[np.float64]
    """(k, n, 4): see `Disturbance`; unused rows have time inf."""
    guards: NDArray[np.float64]
    """(k, 3): least airspeed m/s, largest abs(gamma), largest abs(alpha), beyond which the vehicle is lost."""
    airframe: NDArray[np.float64]
    """(k, 16): see `Airframe`."""
    offset: NDArray[np.float64]
    """(k,): lateral position y, m; constant in the vertical plane."""
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


@compiled
def _onset(since: float, rate: float) -> float:
    return 1.0 if rate == 0.0 else 1.0 - math.exp(-rate * since)


@compiled
def _fault(fleet, i, actuator, time):
    """Effectiveness and bias of an actuator: those of its latest fault."""
    effectiveness = 1.0
    bias = 0.0
    for n in range(fleet.faults.shape[1]):
        since = time - fleet.faults[i, n, 0]
        if since >= 0.0 and int(fleet.faults[i, n, 1]) == actuator:
            effectiveness = 1.0 + (fleet.faults[i, n, 2] - 1.0) * _onset(since, fleet.faults[i, n, 4])
            bias = fleet.faults[i, n, 3] * _onset(since, fleet.faults[i, n, 5])
    return effectiveness, bias


@compiled
def _disturbance(fleet, i, channel, time):
    total = 0.0
    for n in range(fleet.disturbances.shape[1]):
        since = time - fleet.disturbances[i, n, 0]
        if since >= 0.0 and int(fleet.disturbances[i, n, 1]) == channel:
            total += fleet.disturbances[i, n, 2] * _onset(since, fleet.disturbances[i, n, 3])
    return total


@compiled
def _saturated(fleet, i, actuator):
    return min(max(fleet.command[i, actuator], fleet.limits[i, actuator, 0]), fleet.limits[i, actuator, 1])


@compiled
def actuate(fleet, i, time):
    """Set what acts on vehicle ``i`` at ``time`` (s) under the command in force; to be called after each latch."""
    for actuator in range(4):
        effectiveness, bias = _fault(fleet, i, actuator, time)
        if fleet.lag[i, actuator] == 0.0:
            fleet.position[i, actuator] = _saturated(fleet, i, actuator)
        elif fleet.fault_before_lag[i] > 0.0:
            effectiveness, bias = 1.0, 0.0
        fleet.acting[i, actuator] = effectiveness * fleet.position[i, actuator] + bias


@compiled
def _stroke(fleet, i, actuator, time, half, full):
    """Acting deflection at the beginning, middle and end of a step; the lag is integrated exactly.

    ``half`` and ``full`` are exp(-lag h/2) and exp(-lag h); a fault is taken at the middle of the step.
    """
    effectiveness, bias = _fault(fleet, i, actuator, time)
    target = _saturated(fleet, i, actuator)
    before = fleet.position[i, actuator]
    if fleet.lag[i, actuator] == 0.0:
        fleet.position[i, actuator] = target
        deflection = effectiveness * target + bias
        return deflection, deflection, deflection
    if fleet.fault_before_lag[i] > 0.0:
        target = effectiveness * target + bias
        effectiveness, bias = 1.0, 0.0
    middle = target + (before - target) * half
    after = target + (before - target) * full
    fleet.position[i, actuator] = after
    return effectiveness * before + bias, effectiveness * middle + bias, effectiveness * after + bias


@compiled
def advance(fleet, i, start_us, period_us, step_us):
    """Fly vehicle ``i`` for one period from ``start_us`` (us) with the command in force, in RK4 steps of ``step_us``.

    Returns
    -------
    int
        0, or why the vehicle is lost: a key of `LOST`.
    """
    if fleet.point[i] == 1:
        return 0
    a = fields(Airframe, fleet.airframe[i])
    x = fleet.state[i]
    h = step_us / 1e6
    k = 0.5 * h
    half_t, full_t = math.exp(-fleet.lag[i, THRUST] * k), math.exp(-fleet.lag[i, THRUST] * h)
    half_e, full_e = math.exp(-fleet.lag[i, ELEVATOR] * k), math.exp(-fleet.lag[i, ELEVATOR] * h)
    for n in range(period_us // step_us):
        middle = (start_us + n * step_us + step_us // 2) / 1e6
        t0, t1, t2 = _stroke(fleet, i, THRUST, middle, half_t, full_t)
        e0, e1, e2 = _stroke(fleet, i, ELEVATOR, middle, half_e, full_e)
        d1 = _disturbance(fleet, i, 0, middle)
        d2 = _disturbance(fleet, i, 1, middle)
        d3 = _disturbance(fleet, i, 2, middle)
        s0, s3, s4, s5 = x[0], x[3], x[4], x[5]
        r1 = longitudinal_rates(s0, s3, s4, s5, t0, e0, d1, d2, d3, a)
        r2 = longitudinal_rates(s0 + k * r1[0], s3 + k * r1[3], s4 + k * r1[4], s5 + k * r1[5], t1, e1, d1, d2, d3, a)
        r3 = longitudinal_rates(s0 + k * r2[0], s3 + k * r2[3], s4 + k * r2[4], s5 + k * r2[5], t1, e1, d1, d2, d3, a)
        r4 = longitudinal_rates(s0 + h * r3[0], s3 + h * r3[3], s4 + h * r3[4], s5 + h * r3[5], t2, e2, d1, d2, d3, a)
        for j in range(6):
            x[j] += h / 6.0 * (r1[j] + 2.0 * r2[j] + 2.0 * r3[j] + r4[j])
        if not (x[0] >= fleet.guards[i, 0]):
            return 1 if x[0] == x[0] else 4
        if abs(x[3]) > fleet.guards[i, 1]:
            return 2
        if abs(x[4] - x[3]) > fleet.guards[i, 2]:
            return 3
    return 0


@compiled
def _aircraft_truth(fleet, i, out):
    for n in range(out.shape[0]):
        out[n] = 0.0
    out[V], out[X], out[Z] = fleet.state[i, 0], fleet.state[i, 1], fleet.state[i, 2]
    out[GAMMA], out[THETA], out[Q] = fleet.state[i, 3], fleet.state[i, 4], fleet.state[i, 5]
    out[ALPHA] = out[THETA] - out[GAMMA]
    out[Y] = fleet.offset[i]


@compiled
def _point_truth(fleet, i, time, out):
    """A `reference_point` moves at constant velocity from the stamp of its target on."""
    target = fleet.target[i]
    since = time - target[0]
    vx, vy, vz = target[4], target[5], target[6]
    ground = math.sqrt(vx * vx + vy * vy)
    for n in range(out.shape[0]):
        out[n] = 0.0
    out[X] = target[1] + vx * since
    out[Y] = target[2] + vy * since
    out[Z] = target[3] + vz * since
    out[V] = math.sqrt(ground * ground + vz * vz)
    out[GAMMA] = math.atan2(vz, ground)
    out[CHI] = math.atan2(vy, vx)
    out[THETA] = out[GAMMA]


@compiled
def truth(fleet, i, time, out):
    """Write the state of vehicle ``i`` at ``time`` (s) into ``out``, in the order of `TRUTH`."""
    if fleet.point[i] == 1:
        _point_truth(fleet, i, time, out)
    else:
        _aircraft_truth(fleet, i, out)


def effects(fleet: Fleet, i: int, time: float) -> list[float]:
    """Effectiveness (4) and bias (4) of the actuators of vehicle ``i`` at ``time`` (s)."""
    pairs = [_fault(fleet, i, actuator, time) for actuator in range(4)]
    return [pair[0] for pair in pairs] + [pair[1] for pair in pairs]
