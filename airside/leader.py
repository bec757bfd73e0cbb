"""A leader's tick: its profile, the target of its vehicle, and what it shares; the events that autopilots make."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ftcc.airside.autopilots import Autopilots
from ftcc.airside.defence.events import TRUST_KINDS, trust_text
from ftcc.airside.diagnosis.beliefs import Belief
from ftcc.airside.diagnosis.cooperation import BACK, LEFT, NO_ROOM, ROOM, room_text
from ftcc.airside.diagnosis.events import BELIEVES, belief_text
from ftcc.airside.references.longitudinal import Reference
from ftcc.airside.references.profiles import CLAMPED, FIRED, armed, refer, stand
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.actuators import in_slots
from ftcc.link.compiled import compiled, fields, store
from ftcc.link.events import drain_events, note
from ftcc.link.flight_modes import HOLD
from ftcc.link.messages import PositionTarget

__all__ = ["advance_leader", "drain_leader_events"]

_X, _X_DOT, _Z_DOT = (Reference._fields.index(name) for name in ("x", "x_dot", "z_dot"))

_PASSED, _HELD = 1, 2
"""Kinds of events: a trigger fired (its number); the climb rate is held at its limit (1: up, 0: down)."""


@compiled
def _position_of(autopilots, inbox, i, edge):
    """Present forward position of the leader behind in-edge ``edge``, carried on by its speed; nan if never heard."""
    if edge < 0 or inbox.valid[i, edge] == 0.0:
        return math.nan
    position = math.nan
    speed = 0.0
    for m in range(autopilots.shared.shape[1]):
        if autopilots.leader_shares[m] == _X:
            position = inbox.values[i, edge, m]
        elif autopilots.leader_shares[m] == _X_DOT:
            speed = inbox.values[i, edge, m]
    return position + speed * inbox.age[i, edge]


@compiled
def advance_leader(autopilots, inbox, i, now_us, period_us, makes_room):
    """Advance the profile of UAV ``i`` to this tick, set its target and what it shares.

    That its climb rate is held at its limit is no event while it ``makes_room`` for a follower.

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
        watched = _position_of(autopilots, inbox, i, armed(triggers, state))
        clock = now_us - autopilots.held_us[i]
        clamped, fired = state[CLAMPED], state[FIRED]
        refer(autopilots.profile[i], commands, triggers, state, reference, watched, clock, period_us)
        if state[FIRED] > fired:
            note(autopilots.events, now_us, i, _PASSED, int(fired))
        if state[CLAMPED] > clamped and not makes_room:
            note(autopilots.events, now_us, i, _HELD, int(reference[_Z_DOT] > 0.0))
    at = fields(Reference, reference)
    offset = autopilots.offset[i]
    target = PositionTarget(time=now_us / 1e6, x=at.x, y=offset, z=at.z, vx=at.x_dot, vy=0.0, vz=at.z_dot)
    store(target, autopilots.target[i])
    for m in range(autopilots.shared.shape[1]):
        source = autopilots.leader_shares[m]
        autopilots.shared[i, m] = reference[source] if source >= 0 else 0.0


def drain_leader_events(autopilots: Autopilots, specs: Sequence[AutopilotSpec]) -> list[tuple[int, int, str, str]]:
    """Take the events of leaders, and of UAVs that leave, come back, or change a belief or whom they distrust.

    Returns time us, UAV, severity, text of each.
    """
    events = []
    for row, (at_us, i, kind, number) in enumerate(drain_events(autopilots.events)):
        if kind == BELIEVES and autopilots.diagnosis is not None:
            actuator = in_slots(specs[i].diagnosis.actuators)[number]
            before, *belief = autopilots.diagnosis.details[row].tolist()
            events.append((at_us, specs[i].uav, *belief_text(actuator, before, Belief(*belief))))
            continue
        if kind in TRUST_KINDS:
            senders = [neighbour.uav for neighbour in specs[i].neighbours]
            events.append((at_us, specs[i].uav, *trust_text(kind, number, senders)))
            continue
        if kind in (ROOM, NO_ROOM, LEFT, BACK):
            events.append((at_us, specs[i].uav, *room_text(kind, number)))
            continue
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
