"""The recordings of a node on their way home: files in pieces, checked at the end."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path

__all__ = ["FileError", "Receiver", "pieces", "recorded_files"]

_PIECE = 1 << 18
"""Bytes of a piece, at most."""
_FOLDERS = ("parts", "logs")
"""What comes home, of a run's folder."""


class FileError(OSError):
    """A piece that belongs to no file that may be written."""


def recorded_files(folder: Path) -> list[Path]:
    """Return what the processes of a node wrote into its run's folder."""
    return sorted(path for name in _FOLDERS for path in (folder / name).glob("*") if path.is_file())


def pieces(folder: Path, path: Path) -> Iterator[bytes]:
    """Yield a file in pieces, each with a line of JSON before it: its name, offset, and at the end size and digest."""
    digest, offset = hashlib.sha256(), 0
    name = path.relative_to(folder).as_posix()
    with path.open("rb") as file:
        while data := file.read(_PIECE):
            digest.update(data)
            yield json.dumps({"name": name, "offset": offset}).encode() + b"\n" + data
            offset += len(data)
    yield json.dumps({"name": name, "size": offset, "digest": digest.hexdigest()}).encode() + b"\n"


class Receiver:
    """Writes the pieces of one node's files into a run's folder.

    Parameters
    ----------
    folder : the run's.
    allowed : whether a file of this name may come from that node.
    """

    def __init__(self, folder: Path, allowed: Callable[[str], bool]) -> None:
        self._folder = folder
        self._allowed = allowed
        self._digests: dict[str, tuple[int, hashlib._Hash]] = {}
        self.complete: list[str] = []
        """Names of the files that have come whole."""
        self.octets = 0

    def take(self, data: bytes) -> None:
        """Write a piece.

        Raises
        ------
        FileError
            If it is not the next piece of a file that may be written, or the file is not what was sent.
        """
        head, _, body = data.partition(b"\n")
        try:
            about = json.loads(head)
            name = str(about["name"])
        except (ValueError, KeyError, TypeError):
            raise FileError("a piece of no file") from None
        folder, _, file = name.partition("/")
        if folder not in _FOLDERS or not file or "/" in file or file.startswith(".") or not self._allowed(file):
            raise FileError(f"{name}: no file that comes home")
        size, digest = self._digests.setdefault(name, (0, hashlib.sha256()))
        if "digest" in about:
            del self._digests[name]
            if about["size"] != size or about["digest"] != digest.hexdigest():
                raise FileError(f"{name}: came home incomplete")
            if size == 0:
                self._write(name, 0, b"")
            self.complete.append(name)
            return
        if about["offset"] != size:
            raise FileError(f"{name}: a piece is missing")
        self._write(name, size, body)
        digest.update(body)
        self._digests[name] = (size + len(body), digest)
        self.octets += len(body)

    def _write(self, name: str, offset: int, body: bytes) -> None:
        path = self._folder / name
        path.parent.mkdir(exist_ok=True)
        with path.open("r+b" if offset else "wb") as file:
            file.seek(offset)
            file.write(body)
