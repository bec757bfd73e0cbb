"""MAVLink 2 signing of the ground links: the key file, rising time stamps, and what has been heard, across restarts.

A key file holds one line, a pass phrase; the key is its SHA-256, as in MAVProxy and QGroundControl, so that the same
phrase can be typed there.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import secrets
import stat
import time
from pathlib import Path

__all__ = ["KeyFileError", "Signing", "default_key_file", "new_key_file", "read_key"]

_EPOCH = 1_420_070_400
"""2015-01-01 UTC, from which time stamps count in units of 10 us, s since 1970."""
_UNITS = 100_000
_TOLERANCE = 60 * _UNITS
"""By how much a sender that is heard for the first time may be behind."""

Stream = tuple[int, int, int]
"""Link, system and component of a sender."""


class KeyFileError(ValueError):
    """A key file that cannot be used, or must not be overwritten."""


def default_key_file() -> Path:
    """Where `new_key_file` writes unless told otherwise."""
    base = os.environ.get("XDG_CONFIG_HOME")
    return (Path(base) if base else Path.home() / ".config") / "ftcc" / "mavlink.key"


def new_key_file(path: Path) -> None:
    """Write a new random key, readable by the user alone.

    Raises
    ------
    KeyFileError
        If the file is there already, or cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(secrets.token_urlsafe(32) + "\n")
    except FileExistsError:
        raise KeyFileError(f"{path}: is there already; a key is never overwritten") from None
    except OSError as error:
        raise KeyFileError(f"{path}: cannot be written: {error.strerror or error}") from None


def read_key(path: Path) -> bytes:
    """The 32 bytes of the key.

    Raises
    ------
    KeyFileError
        If there is no such file, others may read it, or it holds no phrase.
    """
    try:
        mode = path.stat().st_mode
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise KeyFileError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise KeyFileError(f"{path}: others may read it; make it private: chmod 600 {path}")
    if len(lines) != 1 or len(lines[0]) < 8:
        raise KeyFileError(f"{path}: must hold one line, a pass phrase of at least 8 characters")
    return hashlib.sha256(lines[0].encode()).digest()


def _now() -> int:
    return int((time.time() - _EPOCH) * _UNITS)


class Signing:
    """Key and time stamps of one MAVLink system, shared by all its links.

    Parameters
    ----------
    key : 32 bytes
    memory : Path, optional
        Where stamps are kept, so that a command that was heard before a restart is refused after it.
    link : int
        Which of the links of its system this is, 0..255: stamps rise on each of them.
    """

    def __init__(self, key: bytes, memory: Path | None = None, link: int = 0) -> None:
        self.key = key
        self.link = link
        self._memory = memory
        self._sent = 0
        self._heard: dict[Stream, int] = {}
        self._dirty = False
        if memory is not None:
            self._load(memory)

    def _load(self, memory: Path) -> None:
        with contextlib.suppress(FileNotFoundError):
            try:
                kept = json.loads(memory.read_text())
                self._sent = int(kept["sent"])
                for name, stamp in kept["heard"].items():
                    link, system, component = map(int, name.split("/"))
                    self._heard[link, system, component] = int(stamp)
            except (ValueError, KeyError, AttributeError, TypeError) as error:
                raise KeyFileError(f"{memory}: holds no time stamps ({error}); remove it to start afresh") from None

    def stamp(self) -> int:
        """Time stamp of the next message sent: the clock, but always later than the last one."""
        self._sent = max(self._sent + 1, _now())
        self._dirty = True
        return self._sent

    def genuine(self, message: bytes | bytearray) -> bool:
        """Whether the last six bytes are the signature of those before them."""
        return hashlib.sha256(self.key + bytes(message[:-6])).digest()[:6] == bytes(message[-6:])

    def fresh(self, stream: Stream, stamp: int) -> bool:
        """Whether a genuine message is no repetition; from then on it, and what is older, is one."""
        known = self._heard.get(stream)
        if stamp <= known if known is not None else stamp + _TOLERANCE < _now():
            return False
        self._heard[stream] = stamp
        self._dirty = True
        return True

    def remember(self) -> None:
        """Write the stamps down; to be called before a command is obeyed, and at the end."""
        if self._memory is None or not self._dirty:
            return
        heard = {"/".join(map(str, stream)): stamp for stream, stamp in self._heard.items()}
        self._memory.parent.mkdir(parents=True, exist_ok=True)
        unfinished = self._memory.with_suffix(".new")
        unfinished.write_text(json.dumps({"sent": self._sent, "heard": heard}))
        unfinished.replace(self._memory)
        self._dirty = False
