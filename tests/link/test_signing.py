"""Signed links: who is believed, what is refused as unsigned, forged or repeated, and that restarts forget nothing."""

from __future__ import annotations

import hashlib
import stat
from pathlib import Path

import pytest

from ftcc.link import signing
from ftcc.link.codec import Codec, dialect
from ftcc.link.signing import KeyFileError, Signing, new_key_file, read_key

KEY = hashlib.sha256(b"a phrase").digest()


def command(n: int = 0) -> object:
    return dialect.MAVLink_command_long_message(1, 1, dialect.MAV_CMD_DO_PAUSE_CONTINUE, n, 0, 0, 0, 0, 0, 0, 0)


def beat() -> object:
    return dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


@pytest.fixture
def station() -> Codec:
    return Codec(254, 190, Signing(KEY))


@pytest.fixture
def uav() -> Codec:
    return Codec(1, 1, Signing(KEY))


def kinds(codec: Codec, datagram: bytes) -> list[str]:
    return [message.get_type() for message in codec.parse(datagram)]


def test_a_signed_command_is_read(station, uav):
    assert kinds(uav, station.pack(command())) == ["COMMAND_LONG"]
    assert not uav.not_signed


def test_unsigned_and_wrongly_signed_commands_are_dropped_and_counted_a_heartbeat_is_read(uav):
    stranger = Codec(254, 190, Signing(hashlib.sha256(b"another phrase").digest()))
    assert kinds(uav, Codec(254, 190).pack(command())) == []
    assert kinds(uav, stranger.pack(command())) == []
    assert uav.not_signed.total() == 2
    assert kinds(uav, Codec(254, 190).pack(beat())) == ["HEARTBEAT"]


def test_who_has_no_key_reads_a_signed_heartbeat(uav):
    assert kinds(Codec(255, 190), uav.pack(beat())) == ["HEARTBEAT"]


def test_a_command_is_obeyed_once(station, uav):
    first, second = station.pack(command(0)), station.pack(command(1))
    assert kinds(uav, first) == ["COMMAND_LONG"]
    assert kinds(uav, first) == []
    assert kinds(uav, second) == ["COMMAND_LONG"]
    assert kinds(uav, first) == []
    assert uav.not_signed.total() == 2


def test_a_forged_time_stamp_does_not_shut_the_true_sender_out(station, uav):
    forged = bytearray(station.pack(command()))
    forged[-12:-6] = b"\xff" * 6
    assert kinds(uav, bytes(forged)) == []
    assert kinds(uav, station.pack(command())) == ["COMMAND_LONG"]


def test_what_was_heard_before_a_restart_is_refused_after_it(station, tmp_path):
    memory = tmp_path / "stamps" / "1.json"
    before = Signing(KEY, memory)
    old = station.pack(command())
    assert kinds(Codec(1, 1, before), old) == ["COMMAND_LONG"]
    before.remember()
    after = Codec(1, 1, Signing(KEY, memory))
    assert kinds(after, old) == []
    assert kinds(after, station.pack(command())) == ["COMMAND_LONG"]


def test_stamps_rise_even_where_the_clock_goes_back(monkeypatch, tmp_path):
    memory = tmp_path / "stamps.json"
    one = Signing(KEY, memory)
    sent = [one.stamp() for _ in range(3)]
    assert sent[0] < sent[1] < sent[2]
    one.remember()
    monkeypatch.setattr(signing.time, "time", lambda: 1_500_000_000.0)
    assert Signing(KEY, memory).stamp() > sent[2]


def test_a_sender_heard_for_the_first_time_may_be_a_minute_behind_and_no_more(monkeypatch):
    now = signing.time.time()
    monkeypatch.setattr(signing.time, "time", lambda: now - 50.0)
    late = Codec(254, 190, Signing(KEY)).pack(command())
    monkeypatch.setattr(signing.time, "time", lambda: now - 70.0)
    too_late = Codec(253, 190, Signing(KEY)).pack(command())
    monkeypatch.setattr(signing.time, "time", lambda: now)
    uav = Codec(1, 1, Signing(KEY))
    assert kinds(uav, late) == ["COMMAND_LONG"]
    assert kinds(uav, too_late) == []


def test_a_key_file_is_private_and_never_overwritten(tmp_path):
    path = tmp_path / "deep" / "key"
    new_key_file(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert read_key(path) == hashlib.sha256(path.read_text().strip().encode()).digest()
    with pytest.raises(KeyFileError, match="never overwritten"):
        new_key_file(path)


@pytest.mark.parametrize(
    ("content", "mode", "why"), [("", 0o600, "one line"), ("a phrase\n", 0o644, "others may read it")]
)
def test_a_key_file_that_is_no_secret_is_refused(tmp_path: Path, content: str, mode: int, why: str) -> None:
    path = tmp_path / "key"
    path.write_text(content)
    path.chmod(mode)
    with pytest.raises(KeyFileError, match=why):
        read_key(path)


def test_a_key_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(KeyFileError, match="No such file"):
        read_key(tmp_path / "key")
