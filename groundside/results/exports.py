"""The recording of a run for other programs: CSV, MATLAB, maps (KML, GPX), logs of PX4 (ULog)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ftcc.groundside.results.run import Run
from ftcc.groundside.results.tracks import write_gpx, write_kml

__all__ = ["FORMATS", "export"]


def export(run: Run, format: str, target: Path) -> list[Path]:
    """Write a run's recording into the file ``target``, as "ulog" into that folder; returns the files written.

    Raises
    ------
    ValueError
        If there is no such format in ``FORMATS``.
    RunError
        If nothing was recorded.
    OSError
        If it cannot be written.
    """
    if format not in FORMATS:
        raise ValueError(f"unknown format {format!r}; there are {', '.join(FORMATS)}")
    return FORMATS[format](run, target) or [target]


def _write_csv(run: Run, file: Path) -> None:
    """Comma-separated values, names in the first line."""
    import pyarrow.csv as pc

    pc.write_csv(run.signals, file)


def _write_mat(run: Run, file: Path) -> None:
    """For MATLAB: a struct ``uavN`` per UAV with a field per column, and a struct ``units``."""
    from scipy.io import savemat

    contents: dict[str, Any] = {
        f"uav{uav}": {name: run.column(name, uav) for name in run.names if name != "uav"} for uav in run.uavs
    }
    contents["units"] = {column.name: column.unit for column in run.columns.values() if column.name != "uav"}
    savemat(file, contents, do_compression=True, oned_as="column")


def _write_ulogs(run: Run, folder: Path) -> list[Path]:
    from ftcc.groundside.results.ulog import write_ulogs

    return write_ulogs(run, folder)


FORMATS: dict[str, Callable[[Run, Path], list[Path] | None]] = {
    "csv": _write_csv,
    "mat": _write_mat,
    "kml": write_kml,
    "gpx": write_gpx,
    "ulog": _write_ulogs,
}
"""What writes a run in each format; a list of files where it writes more than one."""
