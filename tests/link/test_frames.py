"""Compiled frames against pymavlink: the same bytes, the same numbers, and nothing else is read.

``python -m tests.link.test_frames 100000 1000000`` tries so many random messages of each kind and mutated datagrams.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ftcc.link import frames
from ftcc.link.codec import Codec, dialect
from ftcc.link.frames import LARGEST_FRAME, Layout, new_payload, read_frame, write_frame
from ftcc.link.wire import new_wire, split

MESSAGES = {
    "ATTITUDE_QUATERNION": frames.ATTITUDE,
    "LOCAL_POSITION_NED": frames.POSITION,
    "HIL_ACTUATOR_CONTROLS": frames.ACTUATORS,
    "SET_ATTITUDE_TARGET": frames.ATTITUDE_TARGET,
    "SET_POSITION_TARGET_LOCAL_NED": frames.POSITION_TARGET,
}
RANDOM = 1500
"""Random messages of each kind."""
MUTATED = 10_000
"""Datagrams."""
_SPECIAL = np.array([0.0, -0.0, 1e-45, -1e-40, 3.4028235e38, -3.4028235e38, 1.0], np.float32)
_POISON = 0xA5


def kind_of(name: str) -> Any:
    return getattr(dialect, f"MAVLink_{name.lower()}_message")


def random_message(name: str, random: np.random.Generator) -> Any:
    """With all fields random; often zeros at the end, numbers at the edges of float32, and extensions."""
    kind = kind_of(name)
    values: dict[str, Any] = {}
    for field, code, count in zip(kind.ordered_fieldnames, kind.native_format.decode()[1:], kind.lengths, strict=True):
        if code == "f":
            drawn = (random.normal(size=count) * 10.0 ** random.integers(-30, 30, count)).astype(np.float32)
            drawn = np.where(random.random(count) < 0.3, random.choice(_SPECIAL, count), drawn)
            numbers = [float(value) for value in drawn]
        else:
            size = {"B": 8, "b": 7, "H": 16, "h": 15, "I": 32, "i": 31, "Q": 63}[code]
            numbers = [int(value) for value in random.integers(0, 2**size, count, np.uint64)]
        if random.random() < 0.25:
            numbers = [0] * count
        values[field] = numbers if count > 1 else numbers[0]
    return kind(**values)


def packed(message: Any, system: int = 1, component: int = 1, sequence: int = 0) -> bytes:
    packer = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
    packer.seq = sequence
    return bytes(message.pack(packer))


def written(message: Any, layout: Layout, system: int = 1, component: int = 1, sequence: int = 0) -> bytes:
    """The frame that compiled code makes of the same payload."""
    payload, out = new_payload(), np.full(2 * LARGEST_FRAME, _POISON, np.uint8)
    whole = payload_of(message)
    payload.octets[: len(whole)] = np.frombuffer(whole, np.uint8)
    end = write_frame(payload, layout, system, component, sequence, out, 3)
    return out[3:end].tobytes() if end > 0 else b""


def fast(data: bytes, poison: int = _POISON) -> list[tuple[int, bytes]] | None:
    """Numbers and payloads of a datagram that consists of frames of a tick alone; else None.

    The datagram lies at the very end of what may be read.
    """
    buffer = np.full(len(data) + 300, poison, np.uint8)
    buffer[: len(data)] = np.frombuffer(data, np.uint8)
    payload, at, found = new_payload(), 0, []
    while at < len(data):
        number, after = read_frame(buffer, at, len(data), payload)
        if number < 0:
            return None
        length = next(layout.length for layout in MESSAGES.values() if layout.number == number)
        found.append((int(number), payload.octets[:length].tobytes()))
        at = after
    return found


def slow(data: bytes) -> tuple[list[tuple[int, bytes]], tuple[int, int]]:
    """What pymavlink makes of it: numbers and payloads, and its counts of bad data and of what is not finite."""
    codec = Codec(1, 1)
    messages = codec.parse(data)
    return [(m.get_msgId(), payload_of(m)) for m in messages], (codec.bad_data, codec.not_finite)


def payload_of(message: Any) -> bytes:
    """As it travels, with all its zeros; of a message of an unknown kind, all its bytes."""
    if not hasattr(message, "unpacker"):
        return bytes(message.get_msgbuf())
    values: list[Any] = []
    for field, code, count in zip(
        message.ordered_fieldnames, message.native_format.decode()[1:], message.lengths, strict=True
    ):
        value = getattr(message, field)
        if code == "c":
            values.append(value.encode() if isinstance(value, str) else value)
        else:
            values += list(value) if count > 1 else [value]
    return bytes(message.unpacker.pack(*values))


def mutated(random: np.random.Generator) -> bytes:
    """A datagram that may come from anybody."""
    names = random.choice(list(MESSAGES), random.integers(1, 4))
    parts = [bytearray(packed(random_message(name, random), sequence=int(random.integers(256)))) for name in names]
    for part in parts:
        for _ in range(random.integers(0, 3)):
            part[random.integers(len(part))] = random.integers(256)
    how = random.integers(9)
    if how == 0:
        parts[-1] = parts[-1][: random.integers(len(parts[-1]) + 1)]
    elif how == 1:
        parts.append(bytearray(random.bytes(random.integers(1, 40))))
    elif how == 2:
        parts.insert(0, bytearray(random.bytes(random.integers(1, 40))))
    elif how == 3:
        parts[0][1] = random.integers(256)
    elif how == 4:
        parts[0][2] = random.choice([1, 2, 128])
    elif how == 5:
        parts[0][0] = 0xFE
    elif how == 6:
        parts[0][7:10] = random.bytes(3)
    return b"".join(map(bytes, parts))


def compare(data: bytes) -> str:
    """How a datagram is read; fails where the fast reader reads what pymavlink reads otherwise, or not at all."""
    quick = fast(data)
    assert fast(data, 0) == quick, "it read beyond the datagram"
    if not data:
        return "empty"
    messages, (bad, not_finite) = slow(data)
    if quick is not None:
        assert quick == messages, data.hex()
        assert (bad, not_finite) == (0, 0), data.hex()
        return "read by both"
    return "read by pymavlink alone, in part or whole" if messages else "read by neither"


@pytest.mark.parametrize("name", MESSAGES)
def test_every_message_has_the_bytes_that_pymavlink_gives_it_and_is_read_back(name: str) -> None:
    try_random_messages(name, RANDOM)


def try_random_messages(name: str, count: int) -> None:
    random = np.random.default_rng(1)
    for n in range(count):
        message = random_message(name, random)
        ids = [int(value) for value in random.integers(1, 256, 2)]
        expected = packed(message, *ids, n % 256)
        assert written(message, MESSAGES[name], *ids, n % 256) == expected
        assert fast(expected) == slow(expected)[0]


def test_whatever_is_not_perfect_is_left_to_pymavlink() -> None:
    counts = try_mutated_datagrams(MUTATED)
    assert min(counts["read by both"], counts["read by neither"]) > MUTATED / 100


def try_mutated_datagrams(count: int) -> Counter[str]:
    random = np.random.default_rng(2)
    return Counter(compare(mutated(random)) for _ in range(count))


def test_random_bytes_are_read_by_neither() -> None:
    random = np.random.default_rng(3)
    for _ in range(2000):
        assert compare(b"\xfd" * random.integers(2) + random.bytes(random.integers(1, 120))) != "read by both"


def test_a_datagram_that_only_pymavlink_reads_gives_the_same_messages_and_counts() -> None:
    random = np.random.default_rng(4)
    wire = new_wire([1], 1)
    seen = 0
    for _ in range(1500):
        data = mutated(random)
        if not data or fast(data) is not None:
            continue
        wire.datagram[: len(data)] = np.frombuffer(data, np.uint8)
        wire.length[0] = len(data)
        codec = Codec(1, 1)
        found = list(read_by_way_of_pymavlink(wire, codec))
        messages, counts = slow(data)
        assert found == messages
        assert (codec.bad_data, codec.not_finite) == counts
        seen += bool(messages)
    assert seen > 100


def read_by_way_of_pymavlink(wire: Any, codec: Codec) -> Iterator[tuple[int, bytes]]:
    """Messages of a tick as they are at hand afterwards, others as they are."""
    for message in split(wire, codec):
        if message is None:
            again = fast(wire.datagram[: wire.length[0]].tobytes())
            assert again is not None
            yield from again
        else:
            yield message.get_msgId(), payload_of(message)


@pytest.mark.parametrize("name", MESSAGES)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_neither_written_nor_read(name: str, value: float) -> None:
    random = np.random.default_rng(5)
    for field, code in zip(kind_of(name).ordered_fieldnames, kind_of(name).native_format.decode()[1:], strict=True):
        if code == "f":
            message = random_message(name, random)
            old = getattr(message, field)
            setattr(message, field, [value, *old[1:]] if isinstance(old, list) else value)
            assert written(message, MESSAGES[name]) == b""
            assert fast(packed(message)) is None
            assert slow(packed(message))[1] == (0, 1)


def test_a_number_too_large_for_float32_is_not_written() -> None:
    payload, out = new_payload(), np.zeros(2 * LARGEST_FRAME, np.uint8)
    with np.errstate(over="ignore"):
        payload.floats[1] = 1e39
    assert write_frame(payload, frames.ATTITUDE, 1, 1, 0, out, 0) == -1


def test_plain_python_writes_the_same_bytes() -> None:
    program = (
        "import hashlib, numpy as np; from tests.link.test_frames import *; r = np.random.default_rng(6)\n"
        "h = hashlib.sha256()\n"
        "for n in range(40):\n"
        "    for name, layout in MESSAGES.items():\n"
        "        data = written(random_message(name, r), layout); h.update(data + repr(fast(data)).encode())\n"
        "print(h.hexdigest())"
    )
    digests = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
            cwd=Path(__file__).parents[2],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for disabled in ("0", "1")
    }
    assert len(digests) == 1


if __name__ == "__main__":
    for one in MESSAGES:
        try_random_messages(one, int(sys.argv[1]))
        print(f"{one}: {sys.argv[1]} random messages", flush=True)
    print(try_mutated_datagrams(int(sys.argv[2])))
