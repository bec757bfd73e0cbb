"""The autopilots of a process as plain arrays: all that their compiled flight works on, from datagram to datagram."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.attacks.arrays import Attacks, new_attacks
from ftcc.airside.autopilots import Autopilots, build
from ftcc.airside.link_events import LinkEvents, link_events
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.actuators import ACTUATORS
from ftcc.link.channel import Inbox
from ftcc.link.exchange import Exchange, Transmission, new_exchange, new_transmission
from ftcc.link.mavlink import AUTOPILOT
from ftcc.link.messages import AttitudeTarget, StateMessage
from ftcc.link.recording import Rows
from ftcc.link.timing import Timing
from ftcc.link.wire import BY_ACTUATORS, BY_ATTITUDE, BY_POSITION, Wire, new_wire

__all__ = ["EVENTS", "LOST", "PUBLISH", "SECOND", "TELEMETRY", "WRITE", "AutopilotGroup", "build_group"]


PUBLISH, WRITE, EVENTS, LOST, TELEMETRY, SECOND = 1, 2, 4, 8, 16, 32
"""What there may be to do after a tick: a transmission for the mesh, full rows, events, UAVs that are lost, telemetry;
and whether a simulated second is full."""


class AutopilotGroup(NamedTuple):
    """k autopilots of one scheme that fly in one process."""

    autopilots: Autopilots
    attacks: Attacks
    inbox: Inbox
    link_events: LinkEvents
    exchange: Exchange
    transmission: Transmission
    """What goes to other processes after an exchange."""
    wire: Wire
    rows: Rows
    """Of the recording; leaders fill none."""
    link_rows: Rows
    """Of the recording of the links."""
    alive: NDArray[np.int64]
    """(k,): 0 once a UAV has ended."""
    active: NDArray[np.int64]
    """(k,): 1 for those that take part in this tick."""
    on_mesh: NDArray[np.int64]
    """(1,): 1 where the process puts transmissions on the mesh."""
    heard_outside: NDArray[np.int64]
    """(k,): 1 for those that have out-neighbours in other processes."""
    travels_by: NDArray[np.int64]
    """(k,): how commands travel to the vehicles, see `wire`."""
    pending: NDArray[np.int64]
    """(k,): tick of the state that has come and was not worked on yet; -1: there is none."""
    arrived: NDArray[np.float64]
    """(k, 13): that state, see ``messages.StateMessage``."""
    arrived_controls: NDArray[np.float64]
    """(k, 4): the command in force that came with it, fractions of travel."""
    command_reported: NDArray[np.int64]
    """(k,): whether such a command came; otherwise the one that answers the last state is in force."""
    states: NDArray[np.float64]
    """(k, 13): the states of this tick."""
    reported: NDArray[np.float64]
    """(k, 4): the commands in force at this tick, as fractions of travel, then in rad and N."""
    controls: NDArray[np.float64]
    """(k, 4): the commands that answer them, fractions of travel."""
    target: NDArray[np.float64]
    """(5,): room for an attitude target."""
    done: NDArray[np.int64]
    """(k,): the last tick of each."""
    lost: NDArray[np.int64]
    """(1,): UAVs whose law gave no finite command and whose end is not reported yet."""
    unsendable: NDArray[np.int64]
    """(1,): 1 where something that was to be sent is not finite."""
    complete: NDArray[np.int64]
    """(1,): lockstep: all transmissions of other processes up to this number have been received."""
    acknowledged: NDArray[np.int64]
    """(1,): lockstep: all receivers of this process have its transmissions up to this number."""
    mail: NDArray[np.int64]
    """(1,): 1 where the mesh has brought something."""
    to_do: NDArray[np.int64]
    """(1,): what Python has to do after a tick: `PUBLISH`, `WRITE`, ... added up."""
    telemetry_us: NDArray[np.int64]
    """(1,): simulated time from which on there is telemetry to send,"""
    telemetry_wall: NDArray[np.float64]
    """(1,): and wall time, s (monotonic): both must have come."""
    attention: NDArray[np.float64]
    """(1,): wall time at which Python looks at its other sockets next, s (monotonic)."""
    since: NDArray[np.float64]
    """(1,): wall time since which states are awaited, s."""
    room: NDArray[np.int64]
    """(2,): for the clock, see `system_calls`."""


def _travels_by(spec: AutopilotSpec) -> int:
    if spec.role == "leader":
        return BY_POSITION
    return BY_ATTITUDE if spec.attitude_code.loading > 0.0 else BY_ACTUATORS


def build_group(specs: Sequence[AutopilotSpec], timing: Timing, rows: Rows, link_rows: Rows) -> AutopilotGroup:
    """Arrays for ``specs``, which share one scheme, before the first tick."""
    k = len(specs)
    autopilots, inbox = build(specs, timing)
    own = [spec.uav for spec in specs]
    senders = [[neighbour.uav for neighbour in spec.neighbours] for spec in specs]
    values = autopilots.shared.shape[1]
    return AutopilotGroup(
        autopilots=autopilots,
        attacks=new_attacks(specs, values, timing),
        inbox=inbox,
        link_events=link_events(specs),
        exchange=new_exchange(own, senders, inbox.valid.shape[1], values),
        transmission=new_transmission(k, values),
        wire=new_wire(own, AUTOPILOT),
        rows=rows,
        link_rows=link_rows,
        alive=np.ones(k, np.int64),
        active=np.zeros(k, np.int64),
        on_mesh=np.zeros(1, np.int64),
        heard_outside=np.array([bool(set(spec.receivers) - set(own)) for spec in specs], np.int64),
        travels_by=np.array([_travels_by(spec) for spec in specs], np.int64),
        pending=np.full(k, -1, np.int64),
        arrived=np.zeros((k, len(StateMessage._fields))),
        arrived_controls=np.zeros((k, len(ACTUATORS))),
        command_reported=np.zeros(k, np.int64),
        states=np.zeros((k, len(StateMessage._fields))),
        reported=np.zeros((k, len(ACTUATORS))),
        controls=np.zeros((k, len(ACTUATORS))),
        target=np.zeros(len(AttitudeTarget._fields)),
        done=np.full(k, -1, np.int64),
        lost=np.zeros(1, np.int64),
        unsendable=np.zeros(1, np.int64),
        complete=np.full(1, -1, np.int64),
        acknowledged=np.full(1, -1, np.int64),
        mail=np.zeros(1, np.int64),
        to_do=np.zeros(1, np.int64),
        telemetry_us=np.zeros(1, np.int64),
        telemetry_wall=np.zeros(1),
        attention=np.zeros(1),
        since=np.zeros(1),
        room=np.zeros(2, np.int64),
    )
