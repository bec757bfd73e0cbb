"""What the swarm's making room works on, a row per UAV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.diagnosis.beliefs import Health, new_health
from ftcc.airside.references import longitudinal
from ftcc.airside.references.profiles import CLIMB_LIMIT, SINK_LIMIT
from ftcc.airside.scheme import Scheme
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.compiled import width

__all__ = ["ATTITUDE", "LONGITUDINAL", "POSITION", "Apart", "Cooperation", "Neighbour", "new_cooperation"]

_PLANTS = ("longitudinal", "attitude", "position")
LONGITUDINAL, ATTITUDE, POSITION = range(len(_PLANTS))
"""What a UAV's own reference is, see ``airside.references``."""


class Neighbour(NamedTuple):
    """What a UAV knows of the health of an in-neighbour; unknown is not healthy."""

    known: float
    """1 where a record that is young enough says it, 0 where none does."""
    state: float
    """The last `Health` that was heard, however old; healthy where none ever was."""
    effectiveness: float
    climb_left: float
    """m/s."""
    belongs: float


assert Neighbour._fields[1:] == Health._fields


class Apart(NamedTuple):
    """Where a UAV stands between flying with the swarm and apart from it, and the flight of one that is apart."""

    weak_for: float
    """Time for which it has not kept up, s."""
    sound_for: float
    """Time for which its actuators have been healthy since it left, s."""
    begun: float
    """1 once the reference of its own has begun."""
    joins: float
    """1 while it flies back to its place."""
    V: float
    """Airspeed that it goes to, m/s."""
    z: float
    """Altitude that it goes to, m."""
    limit: float
    """Of a leader: largest climb and sink rate that its followers leave it, m/s; inf: they leave it its own."""


class Cooperation(NamedTuple):
    """Of k autopilots with at most n in-edges."""

    kind: NDArray[np.int64]
    """(1,): `LONGITUDINAL`, `ATTITUDE` or `POSITION`."""
    columns: NDArray[np.int64]
    """(1,): how many entries the records of followers have for the scheme; leaders' may have more."""
    neighbours: NDArray[np.float64]
    """(k, n, 5): see `Neighbour`."""
    share: NDArray[np.float64]
    """(k, n): share of its weight with which an in-edge counts, 0..1."""
    weight: NDArray[np.float64]
    """(k, n): a_ij of the in-edges while everybody belongs."""
    apart: NDArray[np.float64]
    """(k, c): see `Apart`."""
    limits: NDArray[np.float64]
    """(k, 2): largest climb and sink rate of a leader's own profile, m/s."""
    speed: NDArray[np.float64]
    """(k,): airspeed of the mission, m/s; nan where no reference has one."""
    lone: NDArray[np.float64]
    """(k, 7): motion of the virtual leader of one that is apart, see `longitudinal.Reference`."""
    level: NDArray[np.float64]
    """(k, 1, 4): attitude that one that is apart is commanded to, see `attitude.Command`."""
    records: NDArray[np.float64]
    """(k, 1, m): what the virtual leader shares."""
    edges: NDArray[np.float64]
    """(k, 3, 1): age (s), validity and weight of that record."""
    trust: NDArray[np.float64]
    """(k, 1, m): trust in its values."""


def new_cooperation(
    specs: Sequence[AutopilotSpec],
    scheme: Scheme,
    weight: NDArray[np.float64],
    profile: NDArray[np.float64],
    shared: int,
) -> Cooperation:
    """Before the first tick, when everybody belongs.

    Parameters
    ----------
    specs, scheme : of the autopilots.
    weight : (k, n), a_ij of the in-edges.
    profile : (k, p), see `profile_arrays`.
    shared : numbers in a record.
    """
    k, n = weight.shape
    kind = _PLANTS.index(scheme.plant)
    neighbours = np.zeros((k, n, len(Neighbour._fields)))
    neighbours[:, :, 1:] = new_health(1)[0]
    apart = np.zeros((k, width(Apart)))
    apart[:, Apart._fields.index("limit")] = math.inf
    level = np.zeros((k, 1, 4))
    level[:, 0, 0] = -math.inf
    edges = np.zeros((k, 3, 1))
    edges[:, 1, 0] = 1.0
    # No observer gets faster than with all its neighbours.
    edges[:, 2, 0] = np.where(weight.sum(axis=1) > 0.0, weight.sum(axis=1), 1.0)
    speed = longitudinal.Reference._fields.index("V")
    return Cooperation(
        kind=np.array([kind], np.int64),
        columns=np.array([len(scheme.shared["follower"])], np.int64),
        neighbours=neighbours,
        share=np.ones((k, n)),
        weight=weight.copy(),
        apart=apart,
        limits=profile[:, [CLIMB_LIMIT, SINK_LIMIT]].copy(),
        speed=np.array([spec.reference.initial[speed] if kind == LONGITUDINAL else math.nan for spec in specs]),
        lone=np.zeros((k, len(longitudinal.Reference._fields))),
        level=level,
        records=np.zeros((k, 1, shared)),
        edges=edges,
        trust=np.ones((k, 1, shared)),
    )
