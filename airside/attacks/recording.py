"""What was true and what was told, of those who lie: the columns and rows of its recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.attacks.arrays import LOG_FULL, Attacks, Clock, LogRow
from ftcc.airside.scheme import Quantity, Scheme
from ftcc.link.recording import Column, PartWriter, part_path

__all__ = ["LieRecorder", "drain_lies", "lie_columns"]

_LOGGED = Clock._fields.index("logged")
_TIME, _SENDER, _RECEIVER, _LEADS = range(len(LogRow._fields))
_VALUES = len(LogRow._fields)
_KEYS = [_TIME, _SENDER, _RECEIVER]
_DUE = 0.9
"""Wall time after which rows are written although there is room for more, s."""


def _quantities(scheme: Scheme) -> dict[str, Quantity]:
    """All that UAVs of either role share, by name."""
    return {one.name: one for role in ("follower", "leader") for one in scheme.shared.get(role, ())}


def lie_columns(scheme: Scheme) -> tuple[Column, ...]:
    """Columns of the recording of what was told: a row per false record."""
    known = _quantities(scheme).values()
    return (
        Column("t", "s", "simulated time of the record"),
        Column("uav", "-", "id of whose record it is"),
        Column("receiver", "-", "id of who alone hears the lie; 0: everybody"),
        *(Column(f"true_{one.name}", one.unit, f"true {one.meaning or one.name}") for one in known),
        *(Column(f"told_{one.name}", one.unit, f"told {one.meaning or one.name}") for one in known),
    )


def drain_lies(attacks: Attacks, scheme: Scheme) -> NDArray[np.float64]:
    """Take what was told since the last call: rows (n, c) in the order of `lie_columns`; nan: the UAV shares none."""
    known = list(_quantities(scheme))
    log = attacks.log[: attacks.clock[_LOGGED]]
    m = scheme.shared_width
    rows = np.full((len(log), len(_KEYS) + 2 * len(known)), np.nan)
    rows[:, : len(_KEYS)] = log[:, _KEYS]
    for leads, role in enumerate(("follower", "leader")):
        of_role = log[:, _LEADS] == leads
        for place, quantity in enumerate(scheme.shared.get(role, ())):
            column = len(_KEYS) + known.index(quantity.name)
            rows[of_role, column] = log[of_role, _VALUES + place]
            rows[of_role, column + len(known)] = log[of_role, _VALUES + m + place]
    attacks.clock[_LOGGED] = 0
    return rows


class LieRecorder:
    """The parts of the recording of what was told in one process; each begins with its first lie.

    Parameters
    ----------
    folder : the run's folder.
    uavs : ids of the process's UAVs: of who lies to all, or hears the lie.
    scheme, attacks : what they fly, and what is drained.
    on_trouble : called with the reason when a part cannot be written any further: it ends there, the flight goes on.
    """

    def __init__(
        self,
        folder: Path,
        uavs: Sequence[int],
        scheme: Scheme,
        attacks: Attacks,
        on_trouble: Callable[[str], None],
    ) -> None:
        self._paths = {uav: part_path(folder, uav, "lies") for uav in uavs}
        self._scheme, self._attacks = scheme, attacks
        self._on_trouble = on_trouble
        self._parts: dict[int, PartWriter] = {}
        self._written = time.monotonic()

    def write(self) -> None:
        """Write all that was told since the last call."""
        self._written = time.monotonic()
        if self._attacks.clock[_LOGGED] == 0:
            return
        rows = drain_lies(self._attacks, self._scheme)
        own = np.where(rows[:, _RECEIVER] > 0.0, rows[:, _RECEIVER], rows[:, _SENDER]).astype(int)
        for uav in sorted(set(own.tolist()) & self._paths.keys()):
            self._run(uav, rows[own == uav])

    def _run(self, uav: int, rows: NDArray[np.float64]) -> None:
        try:
            if uav not in self._parts:
                self._parts[uav] = PartWriter(self._paths[uav], lie_columns(self._scheme))
            self._parts[uav].write(rows)
        except OSError as error:
            self._give_up(uav, error)

    def _give_up(self, uav: int, error: OSError) -> None:
        path = self._paths.pop(uav)
        self._parts.pop(uav, None)
        self._on_trouble(f"{path.name} is not written any further: {error.strerror or error}")

    def write_if_due(self) -> None:
        """Write what has waited for about a second of wall time, or what leaves little room."""
        if self._attacks.clock[_LOGGED] >= LOG_FULL or time.monotonic() - self._written > _DUE:
            self.write()

    def close(self) -> None:
        """Write the rest and end the files."""
        self.write()
        for uav, part in tuple(self._parts.items()):
            try:
                part.close()
            except OSError as error:
                self._give_up(uav, error)
