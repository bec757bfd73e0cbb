"""What the real network between computers did to the mesh, as a file of the run: a JSON object a line.

The emulated radio is recorded beside it, in ``links.parquet``: so a report can tell one from the other.
"""

from __future__ import annotations

import dataclasses
import json
import time
from pathlib import Path
from typing import TextIO

from ftcc.link.gate import NetworkReport
from ftcc.link.recording import NETWORK_FILE

__all__ = ["NetworkLog"]


class NetworkLog:
    """Appends reports to ``network.jsonl``, which a flight on one computer does not have."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / NETWORK_FILE
        self._file: TextIO | None = None

    def write(self, report: NetworkReport) -> None:
        """Append a report.

        Raises
        ------
        OSError
            If that is not possible.
        """
        if self._file is None:
            self._file = self._path.open("a", encoding="utf-8", buffering=1)
        line = {"t": report.at_us / 1e6, "wall": round(time.time(), 3), **dataclasses.asdict(report)}
        self._file.write(json.dumps(line, allow_nan=False) + "\n")

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
