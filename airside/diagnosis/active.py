"""What the stages of a tick ask of active fault tolerance, in a swarm that has it; otherwise `passive` answers them."""

from __future__ import annotations

from ftcc.airside.diagnosis.accommodation import accommodate, command_for, is_accommodated
from ftcc.airside.diagnosis.cooperation import cooperate, hears_virtual_leader, is_apart, makes_room, refer_apart
from ftcc.airside.diagnosis.events import note_beliefs
from ftcc.airside.diagnosis.health import share_health
from ftcc.airside.diagnosis.stage import diagnose as _diagnose
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.scheme import Heard
from ftcc.link.compiled import compiled_within, fields

__all__ = [
    "ACTIVE",
    "command_for",
    "diagnose",
    "given_to_law",
    "heard_by_law",
    "is_apart",
    "look_after",
    "makes_room",
    "refer_apart",
    "share_health",
]

ACTIVE = True


@compiled_within
def diagnose(autopilots, i, now_us, dt):
    """What UAV ``i`` finds out about its own actuators, and what its law is told of it; nothing where it is off."""
    if autopilots.diagnosis.on[i] == 1:
        _diagnose(autopilots, i, now_us, dt)
        note_beliefs(autopilots, i, now_us)
        accommodate(autopilots, i, dt)


@compiled_within
def look_after(autopilots, inbox, i, now_us, dt):
    """What UAV ``i`` makes of its neighbours' health, where the swarm makes room."""
    if autopilots.diagnosis.cooperates[i] == 1:
        cooperate(autopilots, inbox, i, now_us, dt)


@compiled_within
def heard_by_law(autopilots, i, heard):
    """What the law of UAV ``i`` hears: its neighbours, ``heard``, or a virtual leader in their place."""
    if hears_virtual_leader(autopilots, i):
        c = autopilots.cooperation
        return Heard(c.records[i], c.edges[i, 0], c.edges[i, 1], c.edges[i, 2], c.trust[i])
    return heard


@compiled_within
def given_to_law(autopilots, i):
    """`Own` and `Model` as the law of UAV ``i`` gets them."""
    if is_accommodated(autopilots, i):
        d = autopilots.diagnosis
        return fields(Own, d.own[i]), fields(Model, d.model[i])
    return fields(Own, autopilots.own[i]), fields(Model, autopilots.model[i])
