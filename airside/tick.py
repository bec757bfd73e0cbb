"""One tick of an autopilot: the stages between what was received and what is sent. A template, see `link.compiled`.

The free name ``scheme`` is the module of the control law, ``references`` that of what its UAVs refer to by themselves.
`autopilots.tick_of` gives this module with both filled in. The functions work on the arrays of `Autopilots`, in the
autopilot process and in the single-process simulation.
"""

from __future__ import annotations

from typing import Any

from ftcc.airside.autopilots import lead
from ftcc.airside.flight_path import Own
from ftcc.airside.lateral_hold import hold_course
from ftcc.airside.model import Model
from ftcc.airside.scheme import Heard
from ftcc.link.actuators import encode_command
from ftcc.link.channel import hear
from ftcc.link.compiled import compiled, copy, fields, store, width
from ftcc.link.modes import HOLD

__all__ = ["SWEEPS", "announce", "anticipate", "control", "hear_and_control", "refer"]

if "scheme" not in globals():
    raise ImportError("ftcc.airside.tick is a template: use ftcc.airside.autopilots.tick_of(scheme)")

scheme: Any = globals()["scheme"]
references: Any = globals()["references"]

_State = scheme.State
_Output = scheme.Output
_Gains = scheme.Gains
_start = scheme.start
_step = scheme.step
_share = scheme.share
_Reference = references.Reference
_refer = references.refer
_STATES = width(_State)
_stand = references.stand
_COMMANDS = len(scheme.COMMANDS)

REFUSAL = ""
"""Why numba cannot compile the scheme, set by `autopilots.tick_of`; empty where it can."""

SWEEPS: int = getattr(scheme, "SWEEPS", 1)
"""Most exchanges of one instant where the exchange is ideal."""

_LARGEST = 1e30
"""Beyond this a command counts as not finite: it would not fit a float32 as a fraction of its travel."""


@compiled
def _heard(autopilots, inbox, i):
    n = inbox.degree[i] if autopilots.mode[i] != HOLD else 0
    return Heard(inbox.values[i, :n], inbox.age[i, :n], inbox.valid[i, :n], autopilots.weight[i, :n])


@compiled
def _begin(autopilots, inbox, i, own, reference, gains):
    if autopilots.started[i] == 0:
        model = fields(Model, autopilots.model[i])
        store(_start(own, _heard(autopilots, inbox, i), reference, model, gains), autopilots.state[i])
        autopilots.started[i] = 1


if hasattr(scheme, "observe"):
    _observe = scheme.observe

    @compiled
    def _show(autopilots, i, before, own, reference, output, gains):
        store(_observe(before, own, reference, output, gains), autopilots.signals[i])

else:

    @compiled
    def _show(autopilots, i, before, own, reference, output, gains):
        store(before, autopilots.signals[i])
        copy(autopilots.output[i, _COMMANDS:], autopilots.signals[i, _STATES:])


@compiled
def refer(autopilots, i, now_us, period_us):
    """Bring what UAV ``i`` refers to by itself to this tick; once at every tick. In hold it stands still."""
    if autopilots.mode[i] == HOLD:
        if _stand(autopilots.reference[i], period_us):
            autopilots.held_us[i] += period_us
        return
    parameters, commands = autopilots.reference_parameters[i], autopilots.reference_commands[i]
    _refer(parameters, commands, autopilots.reference[i], now_us - autopilots.held_us[i], period_us)


@compiled
def announce(autopilots, inbox, i):
    """Set ``shared`` from the state at this instant, before the law's step (exchange in two phases)."""
    own = fields(Own, autopilots.own[i])
    reference = fields(_Reference, autopilots.reference[i])
    gains = fields(_Gains, autopilots.gains[i])
    _begin(autopilots, inbox, i, own, reference, gains)
    output = fields(_Output, autopilots.output[i])
    store(_share(fields(_State, autopilots.state[i]), own, reference, output, gains), autopilots.shared[i])


@compiled
def anticipate(autopilots, inbox, i, dt):
    """Set ``shared`` to what UAV ``i`` would share of this instant given what it has heard; no state advances."""
    own = fields(Own, autopilots.own[i])
    reference = fields(_Reference, autopilots.reference[i])
    gains = fields(_Gains, autopilots.gains[i])
    model = fields(Model, autopilots.model[i])
    state = fields(_State, autopilots.state[i])
    _, output = _step(state, own, _heard(autopilots, inbox, i), reference, model, gains, dt)
    store(_share(state, own, reference, output, gains), autopilots.shared[i])


@compiled
def control(autopilots, inbox, i, dt):
    """Step the law of UAV ``i``: sets state, command, shared values and signals.

    Shared values and signals belong to the instant of the measurement. Returns False, and leaves the command as it was,
    if the law gives a command that is not finite.
    """
    own = fields(Own, autopilots.own[i])
    reference = fields(_Reference, autopilots.reference[i])
    gains = fields(_Gains, autopilots.gains[i])
    model = fields(Model, autopilots.model[i])
    _begin(autopilots, inbox, i, own, reference, gains)
    before = fields(_State, autopilots.state[i])
    after, output = _step(before, own, _heard(autopilots, inbox, i), reference, model, gains, dt)
    shown = autopilots.output[i]
    store(output, shown)
    for n in range(_COMMANDS):
        if not abs(shown[n]) < _LARGEST:
            return False
    store(after, autopilots.state[i])
    store(_share(before, own, reference, output, gains), autopilots.shared[i])
    _show(autopilots, i, before, own, reference, output, gains)
    for n in range(_COMMANDS):
        autopilots.command[i, autopilots.actuator[n]] = shown[n]
    if autopilots.course[i] == autopilots.course[i]:
        hold_course(own, autopilots.course[i], model, autopilots.command[i])
    return True


@compiled
def hear_and_control(autopilots, inbox, active, controls, ok, now_us, period_us):
    """The later stages of a tick of all ``active``: inbox, then the leaders' profiles or the followers' law.

    Followers' commands are written to ``controls`` as fractions of travel (k, 4). ``ok`` (k,) tells whose command is
    finite.
    """
    for i in range(active.shape[0]):
        if active[i] == 1:
            ok[i] = 1
            hear(inbox, i, now_us)
            if autopilots.leader[i] == 1:
                lead(autopilots, inbox, i, now_us, period_us)
            else:
                refer(autopilots, i, now_us, period_us)
                ok[i] = 1 if control(autopilots, inbox, i, period_us / 1e6) else 0
                encode_command(autopilots.command[i], autopilots.travel[i], controls[i])
