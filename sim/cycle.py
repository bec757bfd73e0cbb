"""Flight of a vehicle between two datagrams, compiled. A template, see `link.compiled`.

The free name ``plant`` is the module of the equations of motion. `plants.cycle_of` gives this module with a plant
filled in.
"""

from __future__ import annotations

import math
from typing import Any

from ftcc.link.actuators import SLOT, encode_command
from ftcc.link.callbacks import call
from ftcc.link.compiled import compiled, compiled_apart, compiled_within, fields, fill, moved, store
from ftcc.link.messages import PositionTarget
from ftcc.sim.actuation import IDLE, drive_of, has_autothrottle, hold_speed, stroke
from ftcc.sim.actuation import actuate as plant_actuate
from ftcc.sim.disturbances import disturb, disturbances_are_steady, gust
from ftcc.sim.faults import fault_in_force, faults_are_steady
from ftcc.sim.navigation import navigate
from ftcc.sim.obstacles import watch
from ftcc.sim.plant import ALPHA, CHI, GAMMA, THETA, Guards, V, X, Y, Z
from ftcc.sim.sensors import add_noise, encode_state
from ftcc.sim.turning_air import ROTATION, rotation
from ftcc.sim.wind import AIR, blow, moving_air

__all__ = ["actuate", "advance", "conditions", "measure", "sense", "truth"]

if "plant" not in globals():
    raise ImportError("ftcc.sim.cycle is a template: use ftcc.sim.plants.cycle_of(plant)")

plant: Any = globals()["plant"]

_State = plant.State
_Inputs = plant.Inputs
_Disturbances = plant.Disturbances
_Parameters = plant.Parameters
_rates = plant.rates
_truth = plant.truth
_airspeed = plant.airspeed
_complete = plant.complete
_lost = plant.lost
_SLOTS = tuple(SLOT[name] for name in plant.ACTUATORS)
_CHANNELS = len(plant.DISTURBANCES)
_MOVES = tuple(name for name, _ in plant.DISTURBANCES[-len(AIR) :]) == AIR
"""Whether the plant flies in air that may move."""
_TURNS = plant.Disturbances._fields[-len(ROTATION) :] == ROTATION
"""Whether the air that the plant flies in may turn, too."""
_MODELLED = hasattr(plant, "driven")
"""Whether an external model flies the vehicle: the plant's ``rates`` then move only what is not the model's."""
_GUST = next((n for n, (name, _) in enumerate(plant.DISTURBANCES) if name == "gust"), -1)


@compiled_within
def _set_autothrottle(fleet, i):
    if has_autothrottle(fleet, i):
        hold_speed(fleet, i, _airspeed(fields(_State, fleet.state[i])))


@compiled
def actuate(fleet, i, time):
    """Set what acts on vehicle ``i`` at ``time`` (s) under the command in force; call it after each latch."""
    _set_autothrottle(fleet, i)
    plant_actuate(fleet, i, time)


@compiled_within
def _drive(fleet, i, slot, time, step):
    if slot in _SLOTS:  # known when compiled
        return drive_of(fleet, i, slot, time, step)
    return IDLE


@compiled_within
def _stroke(fleet, i, slot, drives, step):
    if slot in _SLOTS:  # known when compiled
        return stroke(fleet, i, slot, drives[slot], step)
    return 0.0, 0.0, 0.0


@compiled_apart
def _move_air(fleet, i, time, out):
    """Write the motion of the air at vehicle ``i`` into the last of its disturbances ``out``."""
    for component in range(len(AIR)):
        out[_CHANNELS - len(AIR) + component] = moving_air(fleet, i, component, time)


@compiled_apart
def _turn_air(fleet, i, out):
    """Write the rotation of the air at vehicle ``i`` into the last of ``out``, a plant's ``Disturbances``."""
    rotation(fleet, i, out[_CHANNELS:])


@compiled_apart
def _gusts(fleet, i, time):
    return gust(fleet, i, time)


@compiled_apart
def _blow(fleet, i, step):
    blow(fleet, i, step)


@compiled
def _disturb(fleet, i, time, out):
    """Write the disturbances of vehicle ``i``, without the gust of (9.33), into ``out``, see ``DISTURBANCES``."""
    disturb(fleet, i, time, out)
    if _MOVES and fleet.still[i] == 0:
        _move_air(fleet, i, time, out)


@compiled
def _drives(fleet, i, time, h):
    """What moves each actuator in a step of ``h`` (s) whose middle is at ``time`` (s)."""
    _set_autothrottle(fleet, i)
    return (
        _drive(fleet, i, 0, time, h),
        _drive(fleet, i, 1, time, h),
        _drive(fleet, i, 2, time, h),
        _drive(fleet, i, 3, time, h),
    )


@compiled
def _disturbances(fleet, i, time):
    """The disturbances of a step whose middle is at ``time`` (s)."""
    disturbed = fleet.disturbed[i]
    _disturb(fleet, i, time, disturbed)
    if _TURNS and fleet.turns[i] == 1:
        _turn_air(fleet, i, disturbed)
    if _GUST >= 0 and fleet.gust_deviation[i] > 0.0:
        disturbed[_GUST] += _gusts(fleet, i, time)
    return fields(_Disturbances, disturbed)


@compiled
def _step(fleet, i, parameters, drives, d, h):
    """One step of RK4 of ``h`` (s) under the disturbances ``d``."""
    a0, a1, a2 = _stroke(fleet, i, 0, drives, h)
    b0, b1, b2 = _stroke(fleet, i, 1, drives, h)
    c0, c1, c2 = _stroke(fleet, i, 2, drives, h)
    d0, d1, d2 = _stroke(fleet, i, 3, drives, h)
    begin, middle, end = _Inputs(a0, b0, c0, d0), _Inputs(a1, b1, c1, d1), _Inputs(a2, b2, c2, d2)
    x = fleet.state[i]
    s = fields(_State, x)
    r1 = _rates(s, begin, d, parameters)
    r2 = _rates(moved(s, 0.5 * h, r1), middle, d, parameters)
    r3 = _rates(moved(s, 0.5 * h, r2), middle, d, parameters)
    r4 = _rates(moved(s, h, r3), end, d, parameters)
    for j in range(len(s)):
        x[j] += h / 6.0 * (r1[j] + 2.0 * r2[j] + 2.0 * r3[j] + r4[j])


if _MODELLED:
    _driven = plant.driven

    @compiled
    def _fly_model(fleet, i, d, parameters):
        """Let the external model fly a step under the deflections and disturbances ``d`` of its end."""
        acting = fields(_Inputs, fleet.deflection[i])
        store(_driven(fields(_State, fleet.state[i]), acting, d, parameters), fleet.driven[i])
        call(fleet.model[0], i)

else:

    @compiled
    def _fly_model(fleet, i, d, parameters):
        """Nothing: the vehicle has no external model."""


@compiled
def advance(fleet, i, start_us, period_us, step_us):
    """Fly vehicle ``i`` for one period from ``start_us`` (us) with the command in force, in steps of ``step_us``.

    What is the same in all steps of the period is computed in the first one.

    Returns
    -------
    int
        0, or why the vehicle is lost: a key of ``plant.LOST``.
    """
    if fleet.point[i] == 1:
        return 0
    guards = fields(Guards, fleet.guards[i])
    parameters = fields(_Parameters, fleet.airframe[i])
    h = step_us / 1e6
    begin, end = start_us / 1e6, (start_us + period_us) / 1e6
    same_drives = not has_autothrottle(fleet, i) and faults_are_steady(fleet, i, begin, end)
    calm = fleet.still[i] == 1 and fleet.gust_deviation[i] == 0.0
    same_disturbances = calm and disturbances_are_steady(fleet, i, begin, end)
    for n in range(period_us // step_us):
        time = (start_us + n * step_us + step_us // 2) / 1e6
        if n == 0 or not same_drives:
            drives = _drives(fleet, i, time, h)
        if n == 0 or not same_disturbances:
            d = _disturbances(fleet, i, time)
        _step(fleet, i, parameters, drives, d, h)
        _fly_model(fleet, i, d, parameters)
        if _MOVES and fleet.still[i] == 0:
            _blow(fleet, i, start_us // step_us + n + 1)
        why = _lost(fields(_State, fleet.state[i]), guards)
        if why > 0:
            return why
    return 0


@compiled
def _point_truth(fleet, i, time, out):
    """A `reference_point` moves at constant velocity from the stamp of its target on."""
    target = fields(PositionTarget, fleet.target[i])
    since = time - target.time
    ground = math.sqrt(target.vx * target.vx + target.vy * target.vy)
    out[X] = target.x + target.vx * since
    out[Y] = target.y + target.vy * since
    out[Z] = target.z + target.vz * since
    out[V] = math.sqrt(ground * ground + target.vz * target.vz)
    out[GAMMA] = math.atan2(target.vz, ground)
    out[CHI] = math.atan2(target.vy, target.vx)
    out[THETA] = out[GAMMA]


@compiled
def truth(fleet, i, time, out):
    """Write the true state of vehicle ``i`` at ``time`` (s) into ``out`` (13,), in the order of ``plant.TRUTH``."""
    fill(out, 0.0)
    if fleet.point[i] == 1:
        _point_truth(fleet, i, time, out)
    else:
        _truth(fields(_State, fleet.state[i]), fields(_Inputs, fleet.acting[i]), fleet.offset[i], out)
        _complete(out)


@compiled
def conditions(fleet, i, time, out):
    """Write faults and disturbances of vehicle ``i`` at ``time`` (s) into ``out``, see `plants.conditions_of`."""
    count = len(_SLOTS)
    for n, slot in enumerate(_SLOTS):
        out[n], out[count + n], _ = fault_in_force(fleet, i, slot, time)
    _disturb(fleet, i, time, out[2 * count :])


@compiled
def measure(fleet, i, tick, seed, true, out):
    """Write ``true`` (13,) with the measurement noise of vehicle ``i`` at this tick into ``out`` (13,)."""
    if add_noise(true, fleet.noise[i], seed, fleet.uav[i], tick, out):
        if fleet.noise[i, ALPHA] > 0.0:
            # Where the angle of attack is measured, the pitch angle follows from it.
            out[THETA] = out[GAMMA] + out[ALPHA]
        _complete(out)


@compiled
def sense(fleet, i, tick, now_us, seed, true, measured, state, controls):
    """Sense vehicle ``i`` at tick ``tick``, simulated time ``now_us``; note the obstacle zones that it enters.

    Writes the truth into ``true`` (13,), see ``plant.TRUTH``, the same as measured into ``measured`` (13,), the message
    to the autopilot into ``state`` (13,), see ``messages.StateMessage``, with the altitude above the datum, and the
    command in force into ``controls`` (4,), as fractions of travel.
    """
    actuate(fleet, i, now_us / 1e6)
    truth(fleet, i, now_us / 1e6, true)
    watch(fleet.zones, fleet.entered, fleet.events, i, now_us, true[X], true[Z])
    measure(fleet, i, tick, seed, true, measured)
    measured[Z] -= fleet.datum[i]
    encode_state(measured, state)
    navigate(fleet, i, now_us / 1e6, state)
    encode_command(fleet.command[i], fleet.travel[i], controls)
