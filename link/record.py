"""The record that a UAV puts on the mesh: what its neighbours hear of it."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

__all__ = ["RECORD_VERSION", "Record", "RecordError"]

RECORD_VERSION = 1

_HEADER = struct.Struct("<BBBBIqi")
_RADIO_ON = 1
_LAST = 2


class RecordError(ValueError):
    """Bytes that are no record of this version."""


@dataclass(frozen=True)
class Record:
    """Shared values of one UAV at one instant."""

    uav: int
    sequence: int
    stamp_us: int
    """Simulated time for which the values hold, us."""
    values: tuple[float, ...]
    radio_on: bool = True
    last: bool = False
    """The UAV ends here: nothing will follow. A last record carries no values to be used."""
    heard: int = -1
    """Lockstep: the sender has received the records up to this sequence number from all whom it hears."""

    def pack(self) -> bytes:
        """The record as bytes: header, then float64 values, little-endian.

        Raises
        ------
        RecordError
            If a value is not finite: nan never enters the mesh.
        """
        if not all(map(math.isfinite, self.values)):
            raise RecordError(f"UAV {self.uav} would share a value that is not finite: {self.values}")
        flags = (_RADIO_ON if self.radio_on else 0) | (_LAST if self.last else 0)
        header = _HEADER.pack(
            RECORD_VERSION, self.uav, flags, len(self.values), self.sequence, self.stamp_us, self.heard
        )
        return header + struct.pack(f"<{len(self.values)}d", *self.values)

    @classmethod
    def unpack(cls, data: bytes) -> Record:
        """The inverse of `pack`.

        Raises
        ------
        RecordError
            For another version, a wrong length or a value that is not finite.
        """
        if len(data) < _HEADER.size:
            raise RecordError(f"a record of {len(data)} bytes is too short")
        version, uav, flags, count, sequence, stamp_us, heard = _HEADER.unpack_from(data)
        if version != RECORD_VERSION:
            raise RecordError(f"record version {version}, this program speaks {RECORD_VERSION}")
        if len(data) != _HEADER.size + 8 * count:
            raise RecordError(f"a record of {len(data)} bytes does not hold {count} values")
        values = struct.unpack_from(f"<{count}d", data, _HEADER.size)
        if not all(map(math.isfinite, values)):
            raise RecordError(f"UAV {uav} shared a value that is not finite: {values}")
        return cls(uav, sequence, stamp_us, values, bool(flags & _RADIO_ON), bool(flags & _LAST), heard)
