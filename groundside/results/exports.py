"""The recording of a run for other programs: tables, maps, and logs of other systems."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ftcc.groundside.results.folders import RunError, sole_writer
from ftcc.groundside.results.run import Run
from ftcc.groundside.results.tracks import write_gpx, write_kml

__all__ = ["FORMATS", "export"]


def export(run: Run, format: str, target: str | Path | None = None) -> list[Path]:
    """Write a run's recording for another program; returns the files written.

    Parameters
    ----------
    run : Run
    format : str
        A key of ``FORMATS``.
    target : path, optional
        The file; for "ulog" and "rosbag2" the folder. Default: `DEFAULT_NAMES` in the folder ``export`` of the run, but
        for "parquet" ``signals.parquet`` itself.

    Raises
    ------
    MissingPackageError
        If the format needs a package that is not installed.
    RunError
        If there is no such format in ``FORMATS``, or nothing was recorded.
    BusyFolderError
        If another process is exporting into the run's folder.
    OSError
        If it cannot be written.
    """
    if format not in FORMATS:
        raise RunError(f"unknown format {format!r}; there are {', '.join(FORMATS)}")
    if target is not None:
        return FORMATS[format](run, Path(target)) or [Path(target)]
    if format == "parquet":
        return [run.file]
    folder = run.path / "export"
    with sole_writer(folder):
        file = folder / DEFAULT_NAMES[format]
        return FORMATS[format](run, file) or [file]


def _write_csv(run: Run, file: Path) -> None:
    """Comma-separated values, names in the first line."""
    import pyarrow.csv as pc

    pc.write_csv(run.signals, file)


def _write_parquet(run: Run, file: Path) -> None:
    """``signals.parquet`` itself, with units and meanings in the columns' metadata."""
    if file.resolve() != run.file.resolve():
        shutil.copyfile(run.file, file)


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


def _write_mcap(run: Run, file: Path) -> None:
    from ftcc.groundside.results.mcap_log import write_mcap

    write_mcap(run, file)


def _write_rosbag2(run: Run, folder: Path) -> list[Path]:
    from ftcc.groundside.results.rosbag import write_rosbag2

    return write_rosbag2(run, folder)


FORMATS: dict[str, Callable[[Run, Path], list[Path] | None]] = {
    "csv": _write_csv,
    "parquet": _write_parquet,
    "mat": _write_mat,
    "ulog": _write_ulogs,
    "mcap": _write_mcap,
    "rosbag2": _write_rosbag2,
    "kml": write_kml,
    "gpx": write_gpx,
}
"""What writes a run in each format; a list of files where it writes more than one."""

DEFAULT_NAMES = {
    "csv": "signals.csv",
    "mat": "signals.mat",
    "ulog": "ulog",
    "mcap": "flight.mcap",
    "rosbag2": "rosbag2",
    "kml": "tracks.kml",
    "gpx": "tracks.gpx",
}
"""File or folder of each format, where none is given."""
