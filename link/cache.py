"""The cache on disk, from one start to the next: compiled functions, and results that take long to compute.

It lies in a folder named by the hash of all sources that it may depend on: an edit anywhere begins a new one. What is
compiled of a law from another package lies in a folder of its own: an edit there compiles this law alone again. This
module imports neither numba nor numpy, so that kept results are read without them.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import importlib.metadata
import importlib.util
import inspect
import json
import os
import shutil
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from ftcc.link.folders import cache_folder

__all__ = ["SCHEME_ENTRY_POINTS", "CacheBusyError", "alone", "folder", "guest_folder", "in_turn", "kept", "not_kept"]

SCHEME_ENTRY_POINTS = "ftcc.schemes"
"""Entry-point group under which other packages offer schemes."""

_KEPT_CACHES = 6
_DIGITS = 32
"""Hexadecimal digits of a hash that name a file or folder."""
_PACKAGES = ("link", "sim", "airside")
"""Folders beside this one whose compiled functions may become part of others. Files that only use them need not be
named: numba notices an edit of the file of a function itself, and so does `kept`."""
_LIBRARIES = ("numba", "numpy", "pymavlink", "scipy")
"""On which the contents depend beside the sources: pymavlink gives the layouts of messages."""
_POLL, _SILENT, _TIMEOUT = 0.02, 3.0, 30.0
"""A process that waits for another one to write polls, reports that it waits, and gives up after so long, s."""
_LONGEST_TURN = 300.0
"""Longest wait for another process that makes the same, s."""

_warned: set[str] = set()
"""Warnings that this process has given."""

F = TypeVar("F", bound=Callable[..., Any])


class CacheBusyError(OSError):
    """Another process has been writing into the cache for too long: it hangs, or was stopped."""


@contextmanager
def alone(place: Path) -> Iterator[None]:
    """Be the only process that writes into the folder ``place``.

    The kernel holds the lock and frees it when its process dies. A process that waits reports on stderr for which one.

    Raises
    ------
    CacheBusyError
        If another process holds it for half a minute; what it does takes milliseconds.
    """
    place.mkdir(parents=True, exist_ok=True)
    with (place / ".writing").open("a+", encoding="ascii") as file:
        reported = False
        for waited in _waiting(file):
            if waited > _TIMEOUT:
                raise CacheBusyError(f"process {_holder(file)} has held {file.name} for {waited:.0f} s")
            if waited > _SILENT and not reported:
                print(f"ftcc: waiting for process {_holder(file)}, which writes into {place}", file=sys.stderr)
                reported = True
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        try:
            yield
        finally:
            # Explicitly, not by close(): a process forked meanwhile has the file open, too.
            fcntl.flock(file, fcntl.LOCK_UN)


@contextmanager
def in_turn(place: Path) -> Iterator[None]:
    """Do what the file ``place`` stands for while no other process does: it finds in the cache what this one has made.

    It goes ahead where the other takes minutes, as one that is stopped, or where no file can be made.
    """
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            place.parent.mkdir(parents=True, exist_ok=True)
            file = stack.enter_context(place.open("a+", encoding="ascii"))
            stack.callback(fcntl.flock, file, fcntl.LOCK_UN)
            for waited in _waiting(file):
                if waited > _LONGEST_TURN:
                    break
        yield


def _waiting(file: Any) -> Iterator[float]:
    """Wait until this process alone has a file; yields, in the meantime, for how long it has waited, s."""
    began = time.monotonic()
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            yield time.monotonic() - began
        time.sleep(_POLL)


def _holder(file: Any) -> str:
    """Id of the process that holds a lock, as it wrote it there."""
    file.seek(0)
    return file.read() or "(unknown)"


def _own_files() -> list[Path]:
    """Every file of ours whose compiled functions can become part of those of another file."""
    root = Path(__file__).resolve().parent.parent
    return sorted(path for package in _PACKAGES for path in (root / package).rglob("*.py"))


def _guest_files() -> list[Path]:
    """Every file of the packages that offer schemes."""
    found: list[Path] = []
    for entry in importlib.metadata.entry_points(group=SCHEME_ENTRY_POINTS):
        spec = importlib.util.find_spec(entry.module.split(".")[0])
        for place in (spec.submodule_search_locations or []) if spec else []:
            found += Path(place).rglob("*.py")
        if spec and spec.origin and not spec.submodule_search_locations:
            found.append(Path(spec.origin))
    return sorted(set(found))


@functools.cache
def folder() -> Path:
    """The folder of this version of the program; removes the folders of all but its last few versions."""
    versions = [sys.version, *(importlib.metadata.version(name) for name in _LIBRARIES)]
    return _folder_of("compiled", " ".join(versions), _own_files())


@functools.cache
def guest_folder() -> Path:
    """The folder of this version of the program and of the packages that offer schemes; as `folder`."""
    return _folder_of("laws", folder().name, _guest_files())


def _folder_of(kind: str, versions: str, files: Sequence[Path]) -> Path:
    digest = hashlib.sha256(versions.encode())
    for path in files:
        digest.update(str(path).encode())
        digest.update(path.read_bytes())
    own = cache_folder(f"{kind}/{digest.hexdigest()[:_DIGITS]}")
    # Other processes remove folders at the same time, and what lies there may be another user's.
    with contextlib.suppress(OSError):
        os.utime(own)
        others = sorted((path for path in own.parent.iterdir() if path != own), key=lambda path: path.stat().st_mtime)
        for stale in others[: max(0, len(others) - _KEPT_CACHES + 1)]:
            shutil.rmtree(stale, ignore_errors=True)
    return own


def not_kept(error: OSError) -> None:
    """Warn, once for each reason, that nothing can be written into the cache: each start computes it anew."""
    why = error.strerror or error
    text = f"compiled code cannot be kept, each start compiles anew: {why}; set FTCC_CACHE_DIR to a folder with room"
    if text not in _warned:
        _warned.add(text)
        warnings.warn(text, RuntimeWarning, stacklevel=3)


def kept(function: F) -> F:
    """Keep the results of ``function`` on disk: it is called once for each list of arguments, not once a start.

    For functions that depend on their arguments, their own file and the sources named above alone. Arguments and
    results must be JSON; tuples come back as lists. An exception is not kept. Plain Python (``NUMBA_DISABLE_JIT=1``)
    serves comparisons, and keeps nothing.
    """
    source = hashlib.sha256(Path(inspect.getfile(function)).read_bytes()).hexdigest()

    @functools.wraps(function)
    def recalled(*arguments: Any) -> Any:
        if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
            return function(*arguments)
        name = hashlib.sha256(json.dumps([source, *arguments]).encode()).hexdigest()[:_DIGITS]
        path = folder() / "kept" / f"{function.__module__}.{function.__name__}" / f"{name}.json"
        try:
            return json.loads(path.read_bytes())
        except (OSError, ValueError):  # not there, another user's, or damaged
            result = function(*arguments)
        unfinished = path.with_suffix(f".{os.getpid()}")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            unfinished.write_text(json.dumps(result), encoding="utf-8")
            unfinished.replace(path)
        except OSError as error:
            not_kept(error)
            with contextlib.suppress(OSError):
                unfinished.unlink(missing_ok=True)
        return result

    return recalled  # type: ignore[return-value]
