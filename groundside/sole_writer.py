"""One process at a time writes into a folder of results: of two, the later would replace what the first has found."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from ftcc.groundside.errors import UserError

__all__ = ["BusyFolderError", "keep", "sole_writer"]

_kept: dict[tuple[int, int], int] = {}
"""Descriptors of the folders that this process keeps to its end, by device and inode."""


class BusyFolderError(UserError):
    """Another process writes into the folder."""


@contextlib.contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Be the only process that writes into ``folder``, which is created.

    Raises
    ------
    BusyFolderError
        If another one does.
    OSError
        If it cannot be created.
    """
    folder.mkdir(parents=True, exist_ok=True)
    descriptor = _locked(folder)
    try:
        yield
    finally:
        os.close(descriptor)


def keep(folder: Path) -> None:
    """As `sole_writer`, of a folder that is there, until this process ends, however it ends."""
    status = folder.stat()
    place = status.st_dev, status.st_ino
    if place not in _kept:
        _kept[place] = _locked(folder)


def _locked(folder: Path) -> int:
    """A descriptor that holds the kernel's lock on a folder. It leaves no file behind."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise BusyFolderError(f"{folder}: another process is writing there; give another folder") from None
    except OSError:
        # Some network file systems lock no folders: there, two at the same time are not noticed.
        pass
    return descriptor
