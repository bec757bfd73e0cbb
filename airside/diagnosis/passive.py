"""The functions of `active` in a swarm without active fault tolerance: nothing is done, and nothing is compiled."""

from __future__ import annotations

from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.link.compiled import compiled_within, fields

ACTIVE = False


@compiled_within
def diagnose(autopilots, i, now_us, dt):
    pass


@compiled_within
def look_after(autopilots, inbox, i, now_us, dt):
    pass


@compiled_within
def makes_room(autopilots, i):
    return False


@compiled_within
def is_apart(autopilots, i):
    return False


@compiled_within
def refer_apart(autopilots, inbox, i, now_us, period_us):
    pass


@compiled_within
def heard_by_law(autopilots, i, heard):
    return heard


@compiled_within
def given_to_law(autopilots, i):
    return fields(Own, autopilots.own[i]), fields(Model, autopilots.model[i])


@compiled_within
def command_for(autopilots, i, slot, wanted):
    return wanted


@compiled_within
def share_health(autopilots, i):
    pass
