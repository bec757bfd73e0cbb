"""The folders of the user in which the program keeps compiled code, running swarms and keys.

The environment says where they are (``FTCC_...``, ``XDG_...``, ``HOME``). Where such a folder cannot be written, as in
a container without a home, a private one below the system's temporary directory replaces it, with a warning.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import warnings
from pathlib import Path

__all__ = ["NoFolderError", "cache_folder", "config_folder", "matplotlib_folder", "runtime_folder"]

_warned: set[str] = set()
"""Warnings that this process has issued."""


class NoFolderError(OSError):
    """There is no folder to write into; the text says which variable can name one."""


def cache_folder(below: str) -> Path:
    """The folder ``below`` that of the caches: ``FTCC_CACHE_DIR``, or ``ftcc`` in the user's caches.

    Child processes use the same one.

    Raises
    ------
    NoFolderError
    """
    given = os.environ.get("FTCC_CACHE_DIR")
    found = Path(given) if given else _of_user("XDG_CACHE_HOME", ".cache")
    try:
        return _writable(found / below if found else None)
    except OSError as error:
        base = _stand_in(found, error, "FTCC_CACHE_DIR") / "cache"
    try:
        folder = _writable(base / below)
    except OSError as error:
        raise NoFolderError(f"{base / below}: {_why(error)}; set FTCC_CACHE_DIR to a folder that can be") from None
    os.environ["FTCC_CACHE_DIR"] = str(base)
    if found is not None:
        _copy(found / below, folder)
    return folder


def runtime_folder() -> Path:
    """Where running swarms are listed and locks lie; private to the user.

    ``ftcc`` in ``FTCC_RUNTIME_DIR`` or ``XDG_RUNTIME_DIR``, or a folder of the system's temporary directory.

    Raises
    ------
    NoFolderError
    """
    base = os.environ.get("FTCC_RUNTIME_DIR") or os.environ.get("XDG_RUNTIME_DIR")
    if not base:
        return _private_temporary("FTCC_RUNTIME_DIR")
    folder = Path(base) / "ftcc"
    try:
        return _private(_writable(folder, 0o700))
    except OSError as error:
        return _stand_in(folder, error, "FTCC_RUNTIME_DIR")


def config_folder() -> Path:
    """``ftcc`` in the user's configuration; nothing replaces it, and it is not created.

    Raises
    ------
    NoFolderError
        Where there is no home.
    """
    folder = _of_user("XDG_CONFIG_HOME", ".config")
    if folder is None:
        raise NoFolderError("there is no home folder: give a FILE, or set XDG_CONFIG_HOME")
    return folder


def matplotlib_folder() -> None:
    """Give matplotlib a folder (``MPLCONFIGDIR``) where its own cannot be written: it would search fonts each time."""
    if os.environ.get("MPLCONFIGDIR"):
        return
    for own in (_of_user("XDG_CONFIG_HOME", ".config"), _of_user("XDG_CACHE_HOME", ".cache")):
        try:
            _writable(own.with_name("matplotlib") if own else None)
        except OSError:
            os.environ["MPLCONFIGDIR"] = str(cache_folder("matplotlib"))
            return


def _of_user(variable: str, below_home: str) -> Path | None:
    """``ftcc`` in a standard folder of the user; None where there is none."""
    given = Path(os.environ.get(variable) or "")
    if given.is_absolute():  # the standard: others are to be ignored
        return given / "ftcc"
    if os.environ.get("HOME") == "":  # Python takes it for the root
        return None
    try:
        return Path.home() / below_home / "ftcc"
    except (RuntimeError, KeyError):  # neither HOME nor an entry among the users
        return None


def _copy(source: Path, folder: Path) -> None:
    """Start from what a read-only installation holds, if it is root's or the user's own, since it is code."""
    with contextlib.suppress(OSError, shutil.Error):
        if source.stat().st_uid in (0, os.geteuid()) and not any(folder.iterdir()):
            shutil.copytree(source, folder, dirs_exist_ok=True)


def _writable(folder: Path | None, mode: int = 0o777) -> Path:
    """The folder, created.

    Raises
    ------
    OSError
        If it cannot be, or cannot be written into.
    """
    if folder is None:
        raise OSError("there is no home folder")
    folder.mkdir(mode=mode, parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError("Permission denied")
    return folder


def _private(folder: Path) -> Path:
    """A folder, once nobody else owns it or may enter it.

    Raises
    ------
    PermissionError
    """
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
        raise PermissionError("is no folder of this user")
    if stat.S_IMODE(found.st_mode) & 0o077:
        folder.chmod(0o700)
    return folder


def _private_temporary(variable: str) -> Path:
    """This user's folder below the system's temporary directory."""
    import tempfile  # slow to load, and few need it

    try:
        folder = Path(tempfile.gettempdir()) / f"ftcc-{os.geteuid()}"
    except OSError as error:
        raise NoFolderError(f"{_why(error)}; set {variable} to a folder that can be written") from None
    try:
        return _private(_writable(folder, 0o700))
    except OSError as error:
        raise NoFolderError(f"{folder}: {_why(error)}; set {variable} to a folder that can be") from None


def _stand_in(folder: Path | None, error: OSError, variable: str) -> Path:
    """The private folder that is used instead of ``folder``; the user is warned once."""
    instead = _private_temporary(variable)
    text = f"{f'{folder}: {_why(error)}' if folder else error}; {instead} is used instead (set {variable} to choose)"
    if text not in _warned:
        _warned.add(text)
        warnings.warn(text, RuntimeWarning, stacklevel=3)
    return instead


def _why(error: OSError) -> str:
    return f"cannot be written ({error.strerror})" if error.strerror else f"cannot be written ({error})"
