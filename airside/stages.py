"""What the stages of an autopilot's tick do: sense, hear, diagnose, refer, control, publish.

A template, see `instantiate`.

The free name ``scheme`` is the module of the control law, ``references`` that of its UAVs' own references, and
``tolerance`` is `diagnosis.active` or `diagnosis.passive`. `compiled_stages.stages_of` gives this module with all three
filled in. The functions work on the arrays of `Autopilots`:
`flight` calls them in their order in the autopilot process, ``flight_loop`` in the simulation in one process.
"""

from __future__ import annotations

from typing import Any

from ftcc.airside.attacks.lies import deliver_with_lies, is_quiet, tell
from ftcc.airside.defence.arrays import GIVEN, ON, TRUST
from ftcc.airside.defence.stage import defend
from ftcc.airside.flight_path import Own, decode_state
from ftcc.airside.lateral_hold import hold_course
from ftcc.airside.leader import advance_leader
from ftcc.airside.model import Model
from ftcc.airside.scheme import LARGEST_COMMAND, LARGEST_STATE, Heard
from ftcc.link.actuators import decode_command
from ftcc.link.channel import hear as hear_inbox
from ftcc.link.compiled import compiled, compiled_within, copy, fields, store, width
from ftcc.link.exchange import deliver_due, post
from ftcc.link.flight_modes import HOLD
from ftcc.link.messages import StateMessage

__all__ = [
    "ACTIVE",
    "SWEEPS",
    "control",
    "diagnose",
    "hear",
    "predict_shared",
    "publish",
    "refer",
    "sense",
    "set_shared",
]

# A template has no such names until `instantiate` gives them.
if "scheme" not in globals():
    raise ImportError("ftcc.airside.stages is a template: use ftcc.airside.compiled_stages.stages_of(scheme)")

scheme: Any = globals()["scheme"]
references: Any = globals()["references"]
tolerance: Any = globals()["tolerance"]

_State = scheme.State
_Output = scheme.Output
_Gains = scheme.Gains
_start = scheme.start
_step = scheme.step
_share = scheme.share
_Reference = references.Reference
_refer = references.refer
_STATES = width(_State)
_SHARED = len(scheme.SHARED.get("follower", ()))
_stand = references.stand
_COMMANDS = len(scheme.COMMANDS)
_command_for = tolerance.command_for
_diagnose = tolerance.diagnose
_heard_by_law = tolerance.heard_by_law
_is_apart = tolerance.is_apart
_look_after = tolerance.look_after
_makes_room = tolerance.makes_room
_refer_apart = tolerance.refer_apart
_share_health = tolerance.share_health
_given_to_law = tolerance.given_to_law

ACTIVE: bool = tolerance.ACTIVE
"""Whether the UAVs diagnose their actuators."""

REFUSAL = ""
"""Why numba cannot compile the scheme, set by `compiled_stages.stages_of`; empty where it can."""

SWEEPS: int = getattr(scheme, "SWEEPS", 1)
"""Most exchanges of one instant where the exchange is ideal."""

_T = Own._fields.index("t")
_DOWN = StateMessage._fields.index("z")


@compiled
def _is_finite(values, count, largest):
    """Whether the first ``count`` numbers are finite and smaller than ``largest``."""
    for n in range(count):  # noqa: SIM110 (compiled)
        if not abs(values[n]) < largest:
            return False
    return True


@compiled_within
def _heard_by(autopilots, inbox, i):
    n = inbox.degree[i] if autopilots.mode[i] != HOLD else 0
    defence = autopilots.defence
    values = inbox.values[i, :n] if defence.switches[ON] == 0 else defence.heard[GIVEN, i, :n]
    trust = defence.heard[TRUST, i, :n]
    heard = Heard(values, inbox.age[i, :n], inbox.valid[i, :n], autopilots.weight[i, :n], trust)
    return _heard_by_law(autopilots, i, heard)


@compiled_within
def _defend(autopilots, inbox, i, dt):
    """Leave of what UAV ``i`` has heard what its defences leave; to be called once at every tick."""
    n = inbox.degree[i] if autopilots.mode[i] != HOLD else 0
    defend(
        autopilots.defence, i, n, inbox.values[i], inbox.age[i], inbox.valid[i], inbox.stamp[i],
        autopilots.shared[i], autopilots.events, autopilots.own[i, _T], dt,
    )  # fmt: skip


@compiled_within
def _start_law(autopilots, inbox, i, own, reference, gains):
    if autopilots.started[i] == 0:
        model = fields(Model, autopilots.model[i])
        store(_start(own, _heard_by(autopilots, inbox, i), reference, model, gains), autopilots.state[i])
        autopilots.started[i] = 1


if hasattr(scheme, "observe"):
    _observe = scheme.observe

    @compiled_within
    def _set_signals(autopilots, i, before, own, reference, output, gains):
        store(_observe(before, own, reference, output, gains), autopilots.signals[i])

else:

    @compiled_within
    def _set_signals(autopilots, i, before, own, reference, output, gains):
        store(before, autopilots.signals[i])
        copy(autopilots.output[i, _COMMANDS:], autopilots.signals[i, _STATES:])


@compiled
def sense(autopilots, i, state, reported, now_us):
    """Own state of UAV ``i`` from its vehicle's messages (13,) and the command that it reports in force (4,).

    ``reported`` comes as fractions of the travel and is overwritten in rad and N, the position down in ``state`` from
    the datum and is overwritten from the origin that everybody else knows.
    """
    state[_DOWN] -= autopilots.datum[i]
    decode_command(reported, autopilots.travel[i], reported)
    decode_state(state, now_us / 1e6, reported, autopilots.own[i])


@compiled
def hear(attacks, exchange, inbox, events, timing, i, now_us):
    """Take the records that are due for UAV ``i`` through the channels of its in-edges."""
    if is_quiet(attacks):
        deliver_due(exchange, inbox, events.radio_on[i], i, now_us, timing.latency_us, timing.seed)
    else:
        deliver_with_lies(attacks, exchange, inbox, events.radio_on[i], i, now_us, timing.latency_us, timing.seed)
    hear_inbox(inbox, i, now_us)


@compiled_within
def diagnose(autopilots, i, now_us, dt):
    """What UAV ``i`` finds out about its own actuators, and what its law is told of it; nothing where it is off."""
    _diagnose(autopilots, i, now_us, dt)


@compiled
def refer(autopilots, inbox, i, now_us, period_us):
    """Bring the reference of UAV ``i`` to this tick: a leader's profile, a follower's own reference.

    To be called once at every tick, after `hear`: a profile may wait for the position of another leader. In hold
    it stands still.
    """
    _look_after(autopilots, inbox, i, now_us, period_us / 1e6)
    if autopilots.leader[i] == 1:
        advance_leader(autopilots, inbox, i, now_us, period_us, _makes_room(autopilots, i))
        return
    if autopilots.mode[i] == HOLD:
        if _stand(autopilots.reference[i], period_us):
            autopilots.held_us[i] += period_us
        return
    if _is_apart(autopilots, i):
        _refer_apart(autopilots, inbox, i, now_us, period_us)
        return
    parameters, commands = autopilots.reference_parameters[i], autopilots.reference_commands[i]
    _refer(parameters, commands, autopilots.reference[i], now_us - autopilots.held_us[i], period_us)


@compiled
def set_shared(autopilots, inbox, i):
    """Set ``shared`` from the state at this instant, before the law's step, for an ideal exchange."""
    autopilots.stepping[0] = i
    own = fields(Own, autopilots.own[i])
    reference = fields(_Reference, autopilots.reference[i])
    gains = fields(_Gains, autopilots.gains[i])
    _start_law(autopilots, inbox, i, own, reference, gains)
    output = fields(_Output, autopilots.output[i])
    store(_share(fields(_State, autopilots.state[i]), own, reference, output, gains), autopilots.shared[i])
    autopilots.defence.shared_at[i] = own.t


@compiled
def predict_shared(autopilots, inbox, i, dt):
    """Set ``shared`` to what UAV ``i`` would share of this instant given what it has heard; no state advances."""
    autopilots.stepping[0] = i
    own = fields(Own, autopilots.own[i])
    reference = fields(_Reference, autopilots.reference[i])
    gains = fields(_Gains, autopilots.gains[i])
    model = fields(Model, autopilots.model[i])
    state = fields(_State, autopilots.state[i])
    _, output = _step(state, own, _heard_by(autopilots, inbox, i), reference, model, gains, dt)
    store(_share(state, own, reference, output, gains), autopilots.shared[i])


@compiled
def control(autopilots, inbox, i, dt):
    """Step the law of follower ``i``: sets state, command, shared values and signals.

    Shared values and signals belong to the instant of the measurement. Returns False, and leaves the command as it was,
    if the law gives a command, a state or a value to share that is not finite.
    """
    autopilots.stepping[0] = i
    if autopilots.defence.switches[ON] == 1:
        _defend(autopilots, inbox, i, dt)
    reference = fields(_Reference, autopilots.reference[i])
    gains = fields(_Gains, autopilots.gains[i])
    own, model = _given_to_law(autopilots, i)
    _start_law(autopilots, inbox, i, own, reference, gains)
    before = fields(_State, autopilots.state[i])
    after, output = _step(before, own, _heard_by(autopilots, inbox, i), reference, model, gains, dt)
    shown = autopilots.output[i]
    store(output, shown)
    if not _is_finite(shown, _COMMANDS, LARGEST_COMMAND):
        return False
    store(after, autopilots.state[i])
    store(_share(before, own, reference, output, gains), autopilots.shared[i])
    autopilots.defence.shared_at[i] = own.t
    if not (
        _is_finite(autopilots.state[i], _STATES, LARGEST_STATE)
        and _is_finite(autopilots.shared[i], _SHARED, LARGEST_COMMAND)
    ):
        return False
    _set_signals(autopilots, i, before, own, reference, output, gains)
    for n in range(_COMMANDS):
        slot = autopilots.actuator[n]
        autopilots.command[i, slot] = _command_for(autopilots, i, slot, shown[n])
    if autopilots.course[i] == autopilots.course[i]:
        hold_course(own, autopilots.course[i], model, autopilots.command[i])
    return True


@compiled
def publish(autopilots, attacks, exchange, events, i, sequence, now_us):
    """Post what UAV ``i`` shares of this instant to those of this process, or simulation, that hear it."""
    _share_health(autopilots, i)
    values = autopilots.shared[i]
    if not is_quiet(attacks):
        tell(attacks, exchange, values, i, sequence, now_us)
        values = attacks.told[i]
    post(exchange, i, sequence, now_us, events.radio_on[i], values)
