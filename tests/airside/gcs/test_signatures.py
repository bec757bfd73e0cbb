"""Signed links: who is obeyed, who is refused, and that the refusals are told while it flies."""

from __future__ import annotations

import hashlib
import shutil
import socket
import time
from contextlib import closing

import pytest

from ftcc.link import signing
from ftcc.link.codec import Codec
from ftcc.link.mavlink import LOOPBACK
from ftcc.link.signing import Signing, read_key
from tests.airside.gcs.in_flight import M, flying, said


@pytest.fixture
def key(tmp_path):
    path = tmp_path / "key"
    path.write_text("correct horse battery\n")
    path.chmod(0o600)
    return path


@pytest.fixture
def signed(tmp_path, monkeypatch, key):
    with flying(tmp_path, monkeypatch, key=key) as pair:
        yield pair


def write(value):
    return M.MAVLink_param_set_message(1, 1, b"K11", value, M.MAV_PARAM_TYPE_REAL32)


class Wire:
    """Sends datagrams as they are."""

    def __init__(self, bench):
        self.to = (LOOPBACK, bench.block.of(1).ground)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, datagram):
        self.socket.sendto(datagram, self.to)

    def close(self):
        self.socket.close()


def by_clock(monkeypatch, seconds, codec, message):
    """What a sender packs whose clock is off by so many seconds."""
    true = time.time
    with monkeypatch.context() as patch:
        patch.setattr(signing.time, "time", lambda: true() + seconds)
        return codec.pack(message)


def test_who_has_the_key_is_obeyed_and_nobody_else(signed):
    bench, station = signed
    assert station.set(1, "K11", 3.5) == 3.5
    with closing(Wire(bench)) as wire:
        wire.send(Codec(254, 190).pack(write(9.0)))
        assert station.get(1, "K11") == 3.5
    replayed = station._codec.pack(write(4.0))
    port = (LOOPBACK, bench.block.of(1).ground)
    station._socket.sendto(replayed, port)
    assert station.get(1, "K11") == 4.0
    assert station.set(1, "K11", 3.0) == 3.0
    station._socket.sendto(replayed, port)
    assert station.get(1, "K11") == 3.0
    counted = bench.process.gcs_links[0].dropped()
    assert {reason: counted.get(reason) for reason in ("unsigned", "repeated")} == {"unsigned": 1, "repeated": 1}


def test_each_reason_and_sender_is_told_once_and_every_message_counted(signed, key, monkeypatch):
    bench, station = signed
    other = Codec(255, 191, Signing(hashlib.sha256(b"another phrase").digest()))
    late, late_too = (Codec(255, n, Signing(read_key(key))) for n in (192, 193))
    again = Codec(255, 194, Signing(read_key(key))).pack(write(3.0))
    with closing(Wire(bench)) as wire:
        for _ in range(3):
            wire.send(Codec(255, 190).pack(write(9.0)))
            wire.send(other.pack(write(9.0)))
            wire.send(by_clock(monkeypatch, -180.0, late, write(9.0)))
            wire.send(again)
        wire.send(by_clock(monkeypatch, -75.0, late_too, write(9.0)))
        assert station.get(1, "K11") == 3.0
    told = [(event.who, event.text) for event in said(bench) if event.text.startswith("refused")]
    assert told == [
        ("255/190", "refused: 255/190 does not sign: it is not obeyed"),
        ("255/191", "refused: signed by 255/191 with another key"),
        ("255/192", "refused: signed by 255/192, 180 s behind: its clock?"),
        ("255/194", "refused: signed by 255/194 before and sent again, or its clock was put back"),
        ("255/193", "refused: signed by 255/193, 75 s behind: its clock?"),
    ]
    counted = bench.process.gcs_links[0].dropped()
    assert [counted[reason] for reason in ("unsigned", "other key", "late", "repeated")] == [3, 3, 4, 2]


def test_stamps_that_cannot_be_kept_are_told_once_and_end_nothing(signed, key):
    bench, station = signed
    # The folder for them is a file: nobody can write there, whoever he is.
    stamps = key.with_name("key.stamps")
    shutil.rmtree(stamps, ignore_errors=True)
    stamps.write_text("in the way")
    for value in (3.5, 4.0):
        assert station.set(1, "K11", value) == value
    told = [event.text for event in said(bench) if "time stamps" in event.text]
    assert len(told) == 1
    assert "cannot be kept" in told[0]
