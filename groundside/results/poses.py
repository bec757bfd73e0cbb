"""Where each UAV was and how it stood, from its recorded true states: what the logs of other programs contain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results.folders import RunError
from ftcc.groundside.results.run import Run
from ftcc.link.home import Home
from ftcc.sim.plant import TRUTH

__all__ = ["Poses", "poses"]

_RATE = 10
"""Highest rate, Hz; the recording itself keeps its rate."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Poses:
    """The motion of one UAV (n rows), rounded as its simulator sends it; in still air velocities are over ground."""

    time_us: NDArray[np.uint64]
    """(n,): simulated time, us."""
    attitude: Array
    """(n, 4): w, x, y, z of the body's axes (forward, right, down) in north, east, down."""
    rates: Array
    """(n, 3): about the body's axes, rad/s."""
    position: Array
    """(n, 3): north, east, down, m."""
    velocity: Array
    """(n, 3): north, east, down, m/s."""
    heading: Array
    """(n,): of the path, rad."""
    place: NDArray[np.int64]
    """(n, 2): latitude and longitude, 1e-7 deg."""
    altitude: Array
    """(n,): m above mean sea level."""

    @property
    def position_enu(self) -> Array:
        """(n, 3): east, north, up, m."""
        return self.position[:, [1, 0, 2]] * (1.0, 1.0, -1.0)

    @property
    def attitude_enu(self) -> Array:
        """(n, 4): x, y, z, w of the body's axes (forward, left, up) in east, north, up, as ROS has them (REP 103)."""
        w, x, y, z = self.attitude.T
        turned: Array = np.column_stack([x + y, x - y, w - z, w + z]) / np.sqrt(2.0)
        return turned

    @property
    def velocity_body(self) -> Array:
        """(n, 3): along the body's axes (forward, left, up), m/s."""
        w, axis = self.attitude[:, :1], -self.attitude[:, 1:]
        turned = 2.0 * np.cross(axis, self.velocity)
        forward_right_down = self.velocity + w * turned + np.cross(axis, turned)
        return forward_right_down * (1.0, -1.0, -1.0)

    @property
    def rates_body(self) -> Array:
        """(n, 3): about the body's axes (forward, left, up), rad/s."""
        return self.rates * (1.0, -1.0, -1.0)


def poses(run: Run, uav: int) -> Poses:
    """Return a UAV's motion at up to 10 Hz; without rows if no position of it was recorded.

    A point mass has no attitude: it is shown along its path.

    Raises
    ------
    RunError
        If the vehicles recorded nothing.
    """
    from ftcc.sim.sensors import encode_state

    if any(name not in run.names for name in TRUTH):
        raise RunError(f"{run.path}: the vehicles recorded nothing: there is no column {', '.join(TRUTH)}")
    stamps = np.rint(run.column("t", uav) * 1e6).astype(np.uint64)
    truth = np.column_stack([run.column(name, uav) for name in TRUTH])
    chosen = _thin(stamps, np.isfinite(truth[:, :6].sum(axis=1)))
    rows = np.nan_to_num(truth[chosen], nan=0.0)
    messages = np.empty((len(rows), 13))
    for row, message in zip(rows, messages, strict=True):
        encode_state(row, message)
    home = Home(*run.mission.home)
    places = np.array([home.place(north, east) for north, east in messages[:, 7:9].tolist()], np.int64)
    return Poses(
        time_us=stamps[chosen],
        attitude=messages[:, :4],
        rates=messages[:, 4:7],
        position=messages[:, 7:10],
        velocity=messages[:, 10:],
        heading=rows[:, TRUTH.index("chi")],
        place=places.reshape(-1, 2),
        altitude=home.altitude - messages[:, 9],
    )


def _thin(stamps: NDArray[np.uint64], wanted: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the ``wanted`` rows, at most `_RATE` a second."""
    rows = np.flatnonzero(wanted)
    bins = (stamps[rows].astype(np.int64) * _RATE) // 1_000_000
    return rows[np.unique(bins, return_index=True)[1]]
