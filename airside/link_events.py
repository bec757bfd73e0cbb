"""Changes of the radio links in simulated time: those of the scenario, and those that a ground station injects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.spec import AutopilotSpec
from ftcc.link.channel import Channel
from ftcc.link.compiled import compiled

__all__ = ["OWN_RADIO", "LinkEvents", "inject", "link_events", "set_links"]

OWN_RADIO = -1
"""Stands for an in-edge: the UAV's own radio."""

_SPARE = 64
"""Changes that the ground may have waiting in one process."""
_NEVER = np.iinfo(np.int64).max
_BLOCKED = Channel._fields.index("blocked")


class LinkEvents(NamedTuple):
    """Changes of the links of a process's UAVs, in order of time."""

    at_us: NDArray[np.int64]
    """(n,); the largest integer where a row is unused."""
    uav: NDArray[np.int64]
    """(n,): index of the UAV in the process."""
    edge: NDArray[np.int64]
    """(n,): its in-edge, or `OWN_RADIO`."""
    quality: NDArray[np.float64]
    """(n, 7): see `Channel`; nan: as it is."""
    position: NDArray[np.int64]
    """(1,): the next event."""
    radio_on: NDArray[np.int64]
    """(k,): 0 while a UAV's own radio is off."""


def link_events(specs: Sequence[AutopilotSpec]) -> LinkEvents:
    """The link events of ``specs`` in one table, in order of time, with room for more."""
    rows = [
        (event.at_us, i, OWN_RADIO if event.sender is None else spec.edge_from(event.sender), event.channel)
        for i, spec in enumerate(specs)
        for event in spec.link_events
    ]
    size = len(rows) + _SPARE
    events = LinkEvents(
        at_us=np.full(size, _NEVER),
        uav=np.zeros(size, np.int64),
        edge=np.zeros(size, np.int64),
        quality=np.zeros((size, len(Channel._fields))),
        position=np.zeros(1, np.int64),
        radio_on=np.ones(len(specs), np.int64),
    )
    for at_us, i, edge, quality in sorted(rows, key=lambda row: row[:-1]):
        inject(events, at_us, i, edge, quality)
    return events


def inject(events: LinkEvents, at_us: int, uav: int, edge: int, quality: Sequence[float]) -> bool:
    """From ``at_us`` on in-edge ``edge`` of UAV ``uav`` (indices) has this quality; nan leaves a value as it is.

    A change that acts later at the same instant wins. The same change injected twice is one. Returns False where
    there is no room left.
    """
    begin = int(events.position[0])
    end = int(np.searchsorted(events.at_us, _NEVER))
    for n in range(begin, end):
        same = (events.at_us[n], events.uav[n], events.edge[n]) == (at_us, uav, edge)
        if same and np.array_equal(events.quality[n], quality, equal_nan=True):
            return True
    if end == len(events.at_us):
        if begin == 0:
            return False
        # What has happened makes room.
        for column in (events.at_us, events.uav, events.edge, events.quality):
            column[: end - begin] = column[begin:end].copy()
        events.at_us[end - begin :] = _NEVER
        events.position[0] = 0
        begin, end = 0, end - begin
    place = max(begin, int(np.searchsorted(events.at_us, at_us, side="right")))
    for column, value in ((events.at_us, at_us), (events.uav, uav), (events.edge, edge), (events.quality, quality)):
        column[place + 1 : end + 1] = column[place:end].copy()
        column[place] = value
    return True


@compiled
def set_links(events, inbox, now_us):
    """Bring all link events up to ``now_us`` into force."""
    while events.position[0] < events.at_us.shape[0] and events.at_us[events.position[0]] <= now_us:
        n = events.position[0]
        i = events.uav[n]
        if events.edge[n] < 0:
            events.radio_on[i] = 0 if events.quality[n, _BLOCKED] > 0.0 else 1
        else:
            for m in range(events.quality.shape[1]):
                if not math.isnan(events.quality[n, m]):
                    inbox.quality[i, events.edge[n], m] = events.quality[n, m]
        events.position[0] += 1
