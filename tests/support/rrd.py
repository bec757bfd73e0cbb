"""A viewer's recording (.rrd) read back, also while it is being written or after its writer was killed."""

from __future__ import annotations

import struct
import tempfile
import warnings
from pathlib import Path

import rerun as rr

_STREAM_HEADER = 12
_MESSAGE_HEADER = struct.Struct("<QQ")
"""Kind and length of the payload that follows."""


def whole(content: bytes) -> bytes:
    """The content without the message that was being written when the file was read.

    The viewer passes over such an end; ``RrdReader`` refuses the whole file for it.
    """
    end = _STREAM_HEADER
    while end + _MESSAGE_HEADER.size <= len(content):
        _, length = _MESSAGE_HEADER.unpack_from(content, end)
        if end + _MESSAGE_HEADER.size + length > len(content):
            break
        end += _MESSAGE_HEADER.size + length
    return content[:end]


def chunks(path: Path) -> list[rr.chunk.Chunk]:
    """All chunks of the recording, in the file's order."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_bytes(whole(path.read_bytes()))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # no footer before the writer ends
            reader = rr.chunk.RrdReader(copy)
            return reader.stream().to_chunks() if reader.recordings() else []
