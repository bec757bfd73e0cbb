"""Folders of results: a new one for each run, locked for the process that writes into it."""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import os
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from ftcc.groundside.errors import UserError

__all__ = [
    "BusyFolderError",
    "NothingRecordedError",
    "RunError",
    "lock_until_exit",
    "new_folder",
    "reserved_folder",
    "sole_writer",
]

_locks: dict[tuple[int, int], int] = {}
"""Descriptors of the folders that this process locked until its exit, by (device, inode)."""


class BusyFolderError(UserError):
    """Another process is writing into the folder."""


class RunError(UserError):
    """A folder is not a run, or the run cannot be read."""


class NothingRecordedError(RunError):
    """A run ended before anything was recorded."""


@contextlib.contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Create ``folder`` if necessary, and lock it for this process within the ``with`` block.

    Raises
    ------
    BusyFolderError
        If another process holds the lock.
    OSError
        If it cannot be created.
    """
    folder.mkdir(parents=True, exist_ok=True)
    descriptor = _lock(folder)
    try:
        yield
    finally:
        os.close(descriptor)


def lock_until_exit(folder: Path) -> None:
    """Lock an existing folder until this process ends in any way.

    Raises
    ------
    BusyFolderError
        If another process writes into it.
    """
    status = folder.stat()
    place = status.st_dev, status.st_ino
    if place not in _locks:
        _locks[place] = _lock(folder)


def _lock(folder: Path) -> int:
    """Lock a folder; return the descriptor that holds the kernel's lock. The lock leaves no file behind."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise BusyFolderError(f"{folder}: another process is writing there; give another folder") from None
    except OSError:
        # Some network file systems cannot lock folders: there, a second writer is not detected.
        pass
    return descriptor


_RESULT_FILES = ("scenario.toml", "study.toml", "study.parquet", "search.toml")
"""A folder with one of these files contains a run, a study or a search."""


def new_folder(name: str, out: str | Path | None = None, kind: str = "runs") -> Path:
    """Create the folder of a new run: ``out``, or ``runs/<name>-<time>`` in the current folder.

    The folder is locked until this process ends.

    Parameters
    ----------
    name : str
    out : Path, optional
    kind : str
        Instead of ``runs``.

    Raises
    ------
    RunError
        If it cannot be written, or ``out`` already holds a run or a study.
    BusyFolderError
        If another process writes into it.
    """
    folder = Path(kind) if out is None else Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(f"no permission to write into {folder}")
        if out is None:
            folder = _first_free(folder / f"{name}-{datetime.now():%Y%m%d-%H%M%S}")
        lock_until_exit(folder)
        found = [file for file in _RESULT_FILES if (folder / file).exists()]
    except OSError as error:
        instead = "; choose another folder with --out" if out is None else ""
        option = "" if out is None else "--out "
        raise RunError(f"{option}{folder}: cannot be written: {error.strerror or error}{instead}") from None
    if found:
        raise RunError(f"--out {folder}: already holds {found[0]}; give a folder that is empty or does not exist")
    return folder


@contextlib.contextmanager
def reserved_folder(out: str | Path) -> Iterator[Path]:
    """A `new_folder` that is locked within the ``with`` block only, unless this process had locked it before.

    Raises
    ------
    RunError, BusyFolderError
        As `new_folder`.
    """
    before = set(_locks)
    folder = new_folder("", out)
    try:
        yield folder
    finally:
        status = folder.stat()
        place = status.st_dev, status.st_ino
        if place not in before:
            os.close(_locks.pop(place))


def _first_free(stem: Path) -> Path:
    """Create the folder; if it exists, create one with the first free number."""
    for n in itertools.count(2):
        folder = stem if n == 2 else stem.with_name(f"{stem.name}-{n - 1}")
        with contextlib.suppress(FileExistsError):
            folder.mkdir()
            return folder
    raise AssertionError("numbers do not end")
