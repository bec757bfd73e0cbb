"""MAVLink 2 signing of the ground links: the key file, and the time stamps sent and heard, kept across restarts.

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
from typing import Literal, NamedTuple

from ftcc.link.folders import config_folder

__all__ = ["KeyFileError", "Refusal", "Signing", "default_key_file", "new_key_file", "read_key", "stamps_file"]

_EPOCH = 1_420_070_400
"""2015-01-01 UTC, from which time stamps count in units of 10 us, s since 1970."""
_UNITS = 100_000
_SIGNATURE = 6
"""Bytes of a signature: the beginning of a SHA-256."""
_TOLERANCE = 60 * _UNITS
"""By how much the stamps of a new sender may be behind."""

Stream = tuple[int, int, int]
"""Link, system and component of a sender."""

Reason = Literal["unsigned", "other key", "repeated", "late"]
"""Why a message is refused: it has no signature; another key's; one that was heard before; a stamp of long ago."""


class Refusal(NamedTuple):
    """A message that was dropped because of its signature."""

    reason: Reason
    system: int
    component: int
    behind: float = 0.0
    """By how much its time stamp is behind our clock, s."""

    @property
    def text(self) -> str:
        """What was wrong with it, for people."""
        sender = f"{self.system}/{self.component}"
        match self.reason:
            case "unsigned":
                return f"{sender} does not sign: it is not obeyed"
            case "other key":
                return f"signed by {sender} with another key"
            case "late":
                return f"signed by {sender}, {self.behind:.0f} s behind: its clock?"
            case "repeated":
                return f"signed by {sender} before and sent again, or its clock was put back"


class KeyFileError(ValueError):
    """A key file that cannot be used, or must not be overwritten."""


def default_key_file() -> Path:
    """Where `new_key_file` writes unless told otherwise.

    Raises
    ------
    NoFolderError
        Where there is no home: a key does not belong into a temporary folder.
    """
    return config_folder() / "mavlink.key"


def new_key_file(path: Path) -> None:
    """Write a new random key, readable by the user alone.

    Raises
    ------
    KeyFileError
        If the file is there already, or cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w")
    except FileExistsError:
        raise KeyFileError(f"{path}: is there already; a key is never overwritten") from None
    except OSError as error:
        raise KeyFileError(f"{path}: cannot be written: {error.strerror or error}; give another FILE") from None
    try:
        with file:
            file.write(secrets.token_urlsafe(32) + "\n")
    except OSError as error:
        path.unlink()  # half a key would block the next attempt
        raise KeyFileError(f"{path}: cannot be written: {error.strerror or error}; give another FILE") from None


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


def stamps_file(key: Path, system: int, component: int) -> Path:
    """The file, beside the key file, in which a MAVLink component keeps the stamps that it heard."""
    return key.with_name(f"{key.name}.stamps") / f"{system}-{component}.json"


def _now() -> int:
    return int((time.time() - _EPOCH) * _UNITS)


class Signing:
    """Key and time stamps of one MAVLink system, shared by all its links.

    Parameters
    ----------
    key : 32 bytes
    memory : Path, optional
        The file of the stamps: with it, a command heard before a restart is refused after it.
    link : int
        Which of the links of its system this is, 0..255: stamps rise on each of them.

    Raises
    ------
    KeyFileError
        If the memory cannot be read, or holds no stamps.
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
            except FileNotFoundError:
                raise
            except OSError as error:
                raise KeyFileError(f"{memory}: cannot be read: {error.strerror or error}") from None
            except (ValueError, KeyError, AttributeError, TypeError) as error:
                raise KeyFileError(f"{memory}: holds no time stamps ({error}); remove it to start afresh") from None

    def can_remember(self) -> bool:
        """Whether stamps can be written; makes their folder where it can."""
        if self._memory is None:
            return False
        with contextlib.suppress(OSError):
            self._memory.parent.mkdir(parents=True, exist_ok=True)
        return os.access(self._memory.parent, os.W_OK)

    def stamp(self) -> int:
        """Time stamp of the next message sent: the clock, but always later than the last one."""
        self._sent = max(self._sent + 1, _now())
        self._dirty = True
        return self._sent

    def genuine(self, message: bytes | bytearray) -> bool:
        """Whether the last six bytes are the signature of those before them."""
        return hashlib.sha256(self.key + bytes(message[:-_SIGNATURE])).digest()[:_SIGNATURE] == bytes(
            message[-_SIGNATURE:]
        )

    def accept(self, stream: Stream, stamp: int) -> Refusal | None:
        """Accept a genuine message with this time stamp, or say why not: a repetition, or too old.

        Once accepted, the same and older stamps of this stream are repetitions.
        """
        known, behind = self._heard.get(stream), _now() - stamp
        if known is None and behind > _TOLERANCE:
            return Refusal("late", *stream[1:], behind / _UNITS)
        if known is not None and stamp <= known:
            # A large lag means that the sender's clock was set back, a small one a repetition.
            return Refusal("late" if behind > _TOLERANCE else "repeated", *stream[1:], behind / _UNITS)
        self._heard[stream] = stamp
        self._dirty = True
        return None

    def remember(self) -> None:
        """Write the stamps; call it before a command is executed, and at the end.

        Raises
        ------
        OSError
            If they cannot be written; they are still remembered for as long as this process lasts.
        """
        if self._memory is None or not self._dirty:
            return
        heard = {"/".join(map(str, stream)): stamp for stream, stamp in self._heard.items()}
        self._memory.parent.mkdir(parents=True, exist_ok=True)
        unfinished = self._memory.with_suffix(".new")
        unfinished.write_text(json.dumps({"sent": self._sent, "heard": heard}))
        unfinished.replace(self._memory)
        self._dirty = False
