"""The autopilots of a process as plain arrays, a row each, and what all schemes have in common of their tick."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.references import of_plant
from ftcc.airside.references.longitudinal import Reference
from ftcc.airside.references.profiles import (
    CLAMPED,
    FIRED,
    FROM_GROUND,
    PROFILE_PARAMETERS,
    PROFILE_STATES,
    TRIGGER_COLUMNS,
    armed,
    new_profile_state,
    profile_arrays,
    refer,
    stand,
    trigger_rows,
)
from ftcc.airside.scheme import Scheme
from ftcc.airside.schemes import find
from ftcc.airside.spec import AutopilotSpec, OwnReference
from ftcc.link.actuators import ACTUATORS, SLOT, encode_command
from ftcc.link.attitude_target import decode_target, encode_target
from ftcc.link.channel import Channel, Inbox, new_inbox
from ftcc.link.compiled import compiled, instantiate, refusal, uncompile, width
from ftcc.link.events import EventList, drain_events, new_events, note
from ftcc.link.flight_modes import HOLD, MISSION
from ftcc.link.timing import Timing

__all__ = [
    "Autopilots",
    "aim",
    "build",
    "lead",
    "placeholder",
    "tick_of",
    "told",
]

_V, _GAMMA, _CHI = (Own._fields.index(name) for name in ("V", "gamma", "chi"))
X = Reference._fields.index("x")
X_DOT = Reference._fields.index("x_dot")


class Autopilots(NamedTuple):
    """k autopilots of one scheme."""

    own: NDArray[np.float64]
    """(k, 18): see `Own`."""
    reference: NDArray[np.float64]
    """(k, n): the ``Reference`` of the scheme's plant."""
    reference_parameters: NDArray[np.float64]
    """(k, n): see `OwnReference`."""
    reference_commands: NDArray[np.float64]
    """(k, m, c): see `OwnReference`; unused rows have time inf. The last two are free for commands from the ground."""
    state: NDArray[np.float64]
    """(k, n): the scheme's ``State``."""
    output: NDArray[np.float64]
    """(k, n): the scheme's ``Output`` of the last step."""
    started: NDArray[np.int64]
    """(k,): 1 once the law has its initial state."""
    gains: NDArray[np.float64]
    """(k, n): the scheme's ``Gains``."""
    model: NDArray[np.float64]
    """(k, 43): see `Model`."""
    weight: NDArray[np.float64]
    """(k, n): a_ij of the in-edges."""
    leader: NDArray[np.int64]
    """(k,): 1 for a leader."""
    command: NDArray[np.float64]
    """(k, 4): command by slot."""
    target: NDArray[np.float64]
    """(k, 7): a leader's target (stamp s, x, y, z, vx, vy, vz), z up."""
    shared: NDArray[np.float64]
    """(k, m): what the neighbours are told."""
    signals: NDArray[np.float64]
    """(k, n): the scheme's ``SIGNALS``; nan for a leader."""
    travel: NDArray[np.float64]
    """(k, 4): full deflection of the actuators."""
    code: NDArray[np.float64]
    """(k, 3): see `AttitudeCode`."""
    datum: NDArray[np.float64]
    """(k,): altitude from which that in the vehicle's messages counts, m."""
    offset: NDArray[np.float64]
    """(k,): lateral position, m."""
    profile: NDArray[np.float64]
    """(k, 20): parameters of the leaders' profiles."""
    profile_commands: NDArray[np.float64]
    """(k, n, 3): their commands by time; unused rows have time inf. The last `FROM_GROUND` are the ground's."""
    profile_triggers: NDArray[np.float64]
    """(k, n, 4): their commands by position, see `trigger_rows`; unused rows have position inf."""
    profile_state: NDArray[np.float64]
    """(k, 7): see `new_profile_state`."""
    leader_shares: NDArray[np.int64]
    """(m,): which entries of its `Reference` a leader shares; -1 = unused."""
    actuator: NDArray[np.int64]
    """(n,): slot of each of the scheme's commands."""
    course: NDArray[np.float64]
    """(k,): course that `lateral_hold` keeps, rad; nan = it does nothing."""
    mode: NDArray[np.int64]
    """(k,): see `modes`."""
    held_us: NDArray[np.int64]
    """(k,): time spent in hold, by which the clocks of references are behind, us."""
    events: EventList
    """What is to be told, see `told`."""


_PASSED, _HELD = 1, 2
"""Kinds of events: a trigger fired (its number); the climb rate is held at its limit (1: up, 0: down)."""


def told(autopilots: Autopilots, specs: Sequence[AutopilotSpec]) -> list[tuple[int, int, str, str]]:
    """What the autopilots noted since they were asked last: time us, UAV, severity, text."""
    events = []
    for at_us, i, kind, number in drain_events(autopilots.events):
        profile = specs[i].profile
        assert profile is not None
        if kind == _PASSED:
            trigger = profile.triggers[number]
            text = (
                f"leader commanded to {trigger.altitude:g} m, {trigger.speed:g} m/s: "
                f"UAV {trigger.uav} has passed x = {trigger.x:g} m"
            )
            events.append((at_us, specs[i].uav, "info", text))
        else:
            way, limit = ("climb", profile.climb_limit) if number else ("sink", profile.sink_limit)
            events.append((at_us, specs[i].uav, "warning", f"leader's {way} rate held at its limit of {limit:.2f} m/s"))
    return events


@functools.cache
def tick_of(scheme: str) -> ModuleType:
    """The tick of a scheme, by name.

    It is compiled, or, where numba cannot compile the scheme, plain Python: then its ``REFUSAL`` says why.
    """
    law = find(scheme)
    tick = instantiate("ftcc.airside.tick", scheme, scheme=law.module, references=of_plant(law.plant))
    autopilots, inbox = build([placeholder(scheme)], Timing(1, 1, 1, 1, 1, 1, 1))
    because = refusal(tick.control, autopilots, inbox, 0, 0.01)
    if because:
        tick.__dict__["REFUSAL"] = f"scheme {scheme} flies as plain Python, slowly: numba cannot compile it ({because})"
        uncompile([tick, *_with_its_package(law.module)])
    return tick


def _with_its_package(law: ModuleType) -> list[ModuleType]:
    """A scheme's file, and, if it comes from another package than this one, what else of that is loaded."""
    package, own = law.__name__.split(".")[0], __name__.split(".")[0]
    if package == own:
        return [law]
    return [module for name, module in sys.modules.items() if name == package or name.startswith(f"{package}.")]


def placeholder(scheme: str) -> AutopilotSpec:
    """A follower that knows and hears nothing, to compile with."""
    law = find(scheme)
    return AutopilotSpec(
        uav=1,
        role="follower",
        scheme=scheme,
        gains=(0.0,) * len(law.gains_type._fields),
        model=Model(*(0.0,) * len(Model._fields)),
        command=(0.0,) * len(ACTUATORS),
        travel=(0.0,) * len(ACTUATORS),
        reference=OwnReference((0.0,) * len(of_plant(law.plant).Reference._fields)),
        neighbours=(),
        channel=Channel(),
    )


def _commands_of(specs: Sequence[AutopilotSpec]) -> NDArray[np.float64]:
    """The commands of the UAVs' own references as one table, with two free last rows."""
    tables = [spec.reference.commands for spec in specs]
    width = max([1] + [len(row) for table in tables for row in table])
    commands = np.full((len(specs), max(map(len, tables)) + 2, width), math.inf)
    for rows, table in zip(commands, tables, strict=True):
        for row, given in zip(rows, table, strict=False):
            row[:] = given
    return commands


def build(specs: Sequence[AutopilotSpec], timing: Timing) -> tuple[Autopilots, Inbox]:
    """Arrays for ``specs``, which share one scheme, before the first tick."""
    scheme: Scheme = find(specs[0].scheme)
    k = len(specs)
    values = scheme.shared_width
    profiles = [profile_arrays(spec.profile, timing.period) if spec.profile else None for spec in specs]
    rows = max([1 + FROM_GROUND] + [len(pair[1]) for pair in profiles if pair])
    commands = np.full((k, rows, 3), math.inf)
    waits = max([1] + [len(spec.profile.triggers) for spec in specs if spec.profile])
    triggers = np.full((k, waits, TRIGGER_COLUMNS), math.inf)
    parameters = np.zeros((k, PROFILE_PARAMETERS))
    states = np.zeros((k, PROFILE_STATES))
    for i, (spec, pair) in enumerate(zip(specs, profiles, strict=True)):
        if pair and spec.profile:
            parameters[i], commands[i, : len(pair[1])] = pair
            triggers[i, : len(spec.profile.triggers)] = trigger_rows(
                spec.profile, spec.uav, [n.uav for n in spec.neighbours]
            )
            states[i] = new_profile_state(spec.profile)
    inbox = new_inbox([[n.uav for n in spec.neighbours] for spec in specs], [s.uav for s in specs], values, Channel())
    weight = np.zeros(inbox.valid.shape)
    for i, spec in enumerate(specs):
        inbox.quality[i, :] = spec.channel
        weight[i, : len(spec.neighbours)] = [n.weight for n in spec.neighbours]
        for edge, neighbour in enumerate(spec.neighbours):
            if neighbour.briefing:
                inbox.values[i, edge, : len(neighbour.briefing)] = neighbour.briefing
                inbox.valid[i, edge] = 1.0
    shares = [Reference._fields.index(quantity.name) for quantity in scheme.shared.get("leader", ())]
    leader = np.array([spec.role == "leader" for spec in specs], np.int64)
    signals = np.zeros((k, len(scheme.signals)))
    signals[leader == 1] = math.nan
    return (
        Autopilots(
            own=np.zeros((k, len(Own._fields))),
            reference=np.array([spec.reference.initial for spec in specs], np.float64),
            reference_parameters=np.array([spec.reference.parameters for spec in specs], np.float64),
            reference_commands=_commands_of(specs),
            state=np.zeros((k, width(scheme.module.State))),
            output=np.zeros((k, width(scheme.module.Output))),
            started=np.zeros(k, np.int64),
            gains=np.array([spec.gains for spec in specs], np.float64),
            model=np.array([spec.model for spec in specs], np.float64),
            weight=weight,
            leader=leader,
            command=np.array([spec.command for spec in specs], np.float64),
            target=np.zeros((k, 7)),
            shared=np.zeros((k, values)),
            signals=signals,
            travel=np.array([spec.travel for spec in specs], np.float64),
            code=np.array([spec.attitude_code for spec in specs], np.float64),
            datum=np.array([spec.datum for spec in specs], np.float64),
            offset=np.array([spec.offset for spec in specs], np.float64),
            profile=parameters,
            profile_commands=commands,
            profile_triggers=triggers,
            profile_state=states,
            leader_shares=np.array(shares + [-1] * (values - len(shares)), np.int64),
            actuator=np.array([SLOT[name] for name in scheme.commands], np.int64),
            course=np.array([math.nan if spec.course is None else spec.course for spec in specs]),
            mode=np.full(k, MISSION),
            held_us=np.zeros(k, np.int64),
            events=new_events(),
        ),
        inbox,
    )


@compiled
def aim(autopilots, i, target, controls):
    """The command of UAV ``i`` as an attitude target (5,), and what the vehicle reads of it, in fractions of travel."""
    own = autopilots.own[i]
    V, gamma, chi = own[_V], own[_GAMMA], own[_CHI]
    encode_target(autopilots.command[i], V, gamma, chi, autopilots.travel[i], autopilots.code[i], target)
    decode_target(target, V, gamma, chi, autopilots.travel[i], autopilots.code[i], controls)
    encode_command(controls, autopilots.travel[i], controls)


@compiled
def _position_of(autopilots, inbox, i, edge):
    """Present forward position of the leader behind in-edge ``edge``, carried on by its speed; nan if never heard."""
    if edge < 0 or inbox.valid[i, edge] == 0.0:
        return math.nan
    position = math.nan
    speed = 0.0
    for m in range(autopilots.shared.shape[1]):
        if autopilots.leader_shares[m] == X:
            position = inbox.values[i, edge, m]
        elif autopilots.leader_shares[m] == X_DOT:
            speed = inbox.values[i, edge, m]
    return position + speed * inbox.age[i, edge]


@compiled
def lead(autopilots, inbox, i, now_us, period_us):
    """A leader's tick: advance the profile of UAV ``i``, set its target and what it shares.

    To be called after `hear`: a profile may wait for the position of another leader.
    """
    reference = autopilots.reference[i]
    triggers = autopilots.profile_triggers[i]
    state = autopilots.profile_state[i]
    if autopilots.mode[i] == HOLD:
        autopilots.held_us[i] += period_us
        stand(state, reference, period_us)
    else:
        commands = autopilots.profile_commands[i]
        seen = _position_of(autopilots, inbox, i, armed(triggers, state))
        clock = now_us - autopilots.held_us[i]
        clamped, fired = state[CLAMPED], state[FIRED]
        refer(autopilots.profile[i], commands, triggers, state, reference, seen, clock, period_us)
        if state[FIRED] > fired:
            note(autopilots.events, now_us, i, _PASSED, int(fired))
        if state[CLAMPED] > clamped:
            note(autopilots.events, now_us, i, _HELD, int(reference[4] > 0.0))
    target = autopilots.target[i]
    target[0] = now_us / 1e6
    target[1], target[2], target[3] = reference[0], autopilots.offset[i], reference[3]
    target[4], target[5], target[6] = reference[X_DOT], 0.0, reference[4]
    for m in range(autopilots.shared.shape[1]):
        source = autopilots.leader_shares[m]
        autopilots.shared[i, m] = reference[source] if source >= 0 else 0.0
