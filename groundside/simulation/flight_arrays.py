"""The arrays of a flight in one process: a whole swarm, and what is recorded of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.attacks.arrays import Attacks, new_attacks
from ftcc.airside.autopilots import Autopilots
from ftcc.airside.autopilots import build as build_autopilots
from ftcc.airside.link_events import LinkEvents, link_events
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.actuators import ACTUATORS
from ftcc.link.channel import LINK_REPORT, Inbox
from ftcc.link.exchange import Exchange, new_exchange
from ftcc.link.messages import AttitudeTarget, StateMessage
from ftcc.link.timing import Timing
from ftcc.sim.build import build_fleet
from ftcc.sim.fleet import Fleet
from ftcc.sim.plant import TRUTH
from ftcc.sim.spec import VehicleSpec

__all__ = ["Kept", "Recording", "World", "new_recording", "new_world"]


class Kept(NamedTuple):
    """Which entries of each part of a row are recorded."""

    truth: NDArray[np.int64]
    command: NDArray[np.int64]
    acting: NDArray[np.int64]
    conditions: NDArray[np.int64]
    signals: NDArray[np.int64]


class Recording(NamedTuple):
    """Rows of the recording, by time, then UAV; nan after a UAV was lost. Each column lies in one piece."""

    kept: Kept
    """What is recorded of the following; all of it: as many columns as given there."""
    truth: NDArray[np.float64]
    """(n, k, 13)."""
    command: NDArray[np.float64]
    """(n, k, 4): commands in force."""
    acting: NDArray[np.float64]
    """(n, k, 4): actuator positions that act on the airframe."""
    conditions: NDArray[np.float64]
    """(n, k, c): what only the simulator knows, see ``sim.plants.conditions_of``."""
    signals: NDArray[np.float64]
    """(n, k, s)."""
    links: NDArray[np.float64]
    """(m, k, e, 6): by in-edge, see ``link.channel.LINK_REPORT``, then trust; nan where there is none."""
    lost: NDArray[np.int64]
    """(k,): cause of a loss, see ``sim.plant.LOST``; 0 = not lost."""
    lost_us: NDArray[np.int64]
    """(k,): time of a loss, us."""
    first: NDArray[np.int64]
    """(2,): numbers, within the flight, of the first row and the first report in this recording."""

    def begin(self, row: int, report: int) -> None:
        """Clear the recording; it then begins with row ``row`` and report ``report`` of the flight."""
        for part in (self.truth, self.command, self.acting, self.conditions, self.signals, self.links):
            part.fill(np.nan)
        self.first[:] = row, report


def new_recording(rows: int, reports: int, kept: Kept, edges: tuple[int, int]) -> Recording:
    """Return an empty recording of ``rows`` ticks and ``reports`` reports on links.

    ``edges`` holds the number of UAVs and the largest number of in-edges.
    """
    k = edges[0]
    # Column by column: claims and verdicts read whole columns, each many times.
    truth, command, acting, conditions, signals = (
        np.full((rows, k, len(places)), np.nan, order="F") for places in kept
    )
    return Recording(
        kept=kept,
        truth=truth,
        command=command,
        acting=acting,
        conditions=conditions,
        signals=signals,
        links=np.full((reports, *edges, len(LINK_REPORT) + 1), np.nan),
        lost=np.zeros(k, np.int64),
        lost_us=np.zeros(k, np.int64),
        first=np.zeros(2, np.int64),
    )


class World(NamedTuple):
    """A whole swarm in one process: all arrays of a flight."""

    fleet: Fleet
    autopilots: Autopilots
    attacks: Attacks
    inbox: Inbox
    events: LinkEvents
    exchange: Exchange
    recording: Recording
    true: NDArray[np.float64]
    """(k, 13): the states of this tick."""
    measured: NDArray[np.float64]
    """(13,): scratch for a measured state."""
    state: NDArray[np.float64]
    """(13,): scratch for a state as a message carries it."""
    controls: NDArray[np.float64]
    """(4,): scratch for a command as a message carries it."""
    target: NDArray[np.float64]
    """(5,): scratch for an attitude target."""
    conditions: NDArray[np.float64]
    """(c,): scratch for what only the simulator knows."""


def new_world(
    vehicles: Sequence[VehicleSpec],
    specs: Sequence[AutopilotSpec],
    timing: Timing,
    conditions: int,
    room: int | None = None,
    kept: Sequence[Sequence[int]] | None = None,
) -> World:
    """Return the swarm before the first tick; ``conditions`` is the number of columns that only the simulator has.

    The recording has space for ``room`` ticks, by default for all, and for the columns ``kept``, in the order of
    `Kept`, by default for all.
    """
    autopilots, inbox = build_autopilots(specs, timing)
    uavs = [spec.uav for spec in specs]
    senders = [[neighbour.uav for neighbour in spec.neighbours] for spec in specs]
    signals, values = autopilots.signals.shape[1], autopilots.shared.shape[1]
    if kept is None:
        kept = [range(width) for width in (len(TRUTH), len(ACTUATORS), len(ACTUATORS), conditions, signals)]
    kept_places = Kept(*(np.array(places, np.int64) for places in kept))
    last = (timing.ticks + 1 if room is None else room) - 1
    rows, reports = last // timing.record_every + 1, last // timing.report_every + 1
    return World(
        fleet=build_fleet(vehicles),
        autopilots=autopilots,
        attacks=new_attacks(specs, values, timing),
        inbox=inbox,
        events=link_events(specs),
        exchange=new_exchange(uavs, senders, inbox.valid.shape[1], values),
        recording=new_recording(rows, reports, kept_places, inbox.valid.shape),
        true=np.zeros((len(uavs), len(TRUTH))),
        measured=np.zeros(len(TRUTH)),
        state=np.zeros(len(StateMessage._fields)),
        controls=np.zeros(len(ACTUATORS)),
        target=np.zeros(len(AttitudeTarget._fields)),
        conditions=np.zeros(conditions),
    )
