"""Targets from the ground: which a UAV takes depends on what it refers to."""

from __future__ import annotations

import math
import re
import time
from typing import TYPE_CHECKING, Any

from ftcc.airside.gcs.answers import ACCEPTED
from ftcc.airside.gcs.flight_modes import set_mode
from ftcc.airside.gcs.motion import lead, read_target
from ftcc.airside.references import of_plant
from ftcc.link.flight_modes import HOLD, OFFBOARD
from ftcc.link.mavlink import dialect

if TYPE_CHECKING:
    from ftcc.airside.gcs.gcs_link import GcsLink

__all__ = ["Offboard"]

_M = dialect
_FRESH = 1.0
"""Time for which a target lets a UAV enter offboard, simulated or wall s: a client knows the latter alone."""
_NEVER = 2**62
"""Beyond every simulated time, us."""


_NUMBER = re.compile(r"[-+.\d]+(e[-+]?\d+)?")


class Offboard:
    """Targets from the ground for one UAV.

    A leader takes altitude and speed (SET_POSITION_TARGET_*). A follower takes an attitude (SET_ATTITUDE_TARGET) where
    the reference of its plant is one: the module then has ``command_from_ground``. Without targets for as long as
    COM_OF_LOSS_T says, in simulated time, offboard becomes hold: a swarm that is held loses nothing.
    """

    def __init__(self, link: GcsLink) -> None:
        self._link = link
        self._references = of_plant(link.seat.scheme.plant)
        self._last = -math.inf
        """Wall time of the last target, s (monotonic)."""
        self._last_us = -_NEVER
        """Simulated time of the tick at which it could act, us."""
        self._target: tuple[float, ...] | None = None
        self.refused_target = ""
        """Why the last target was not taken; empty if it was."""

    @property
    def _takes_attitudes(self) -> bool:
        return not self._link.seat.leader and hasattr(self._references, "command_from_ground")

    def refused(self) -> str:
        """Why this UAV takes no targets; empty if it does."""
        return "" if self._link.seat.leader or self._takes_attitudes else "offboard: this follower takes no targets"

    def fresh(self) -> bool:
        """Whether targets keep coming."""
        simulated = (self._link.seat.next_us - self._last_us) / 1e6
        return min(simulated, time.monotonic() - self._last) < _FRESH

    def enter(self) -> None:
        """Offboard begins: the time without targets counts from now on."""
        self._last_us = self._link.seat.next_us

    def release(self) -> None:
        """The UAV's own commands are in force again."""
        seat = self._link.seat
        if self._takes_attitudes:
            seat.autopilots.reference_commands[seat.i, -1] = math.inf
        self._target = None

    @property
    def running(self) -> bool:
        """Whether offboard ends if nothing comes."""
        seat = self._link.seat
        return bool(seat.autopilots.mode[seat.i] == OFFBOARD) and seat.patience > 0.0

    @property
    def next_us(self) -> int:
        """When it ends, simulated us."""
        return self._last_us + round(self._link.seat.patience * 1e6) if self.running else _NEVER

    def expire(self, now_us: int) -> None:
        """Fall back where the targets have stopped."""
        if now_us < self.next_us:
            return
        seat = self._link.seat
        set_mode(self._link, HOLD)
        self._link.text(_M.MAV_SEVERITY_WARNING, "no targets: offboard becomes hold")
        seat.note("no targets from the ground: offboard becomes hold", "warning")

    def take(self, message: Any) -> None:
        """A target. In offboard it acts at once, before that it shows that targets are there."""
        why = self.refused()
        by_attitude = message.get_type() == "SET_ATTITUDE_TARGET"
        if not why and by_attitude and not self._takes_attitudes:
            why = "a leader takes positions, no attitudes"
        elif not why and not by_attitude and not self._link.seat.leader:
            why = "a follower takes attitudes, no positions"
        if why:
            self._complain(why)
        elif by_attitude:
            self._attitude(message)
        else:
            self._position(message)

    def _heard(self) -> None:
        """A target that makes sense has come."""
        self._last, self._last_us = time.monotonic(), self._link.seat.next_us

    def _attitude(self, message: Any) -> None:
        seat = self._link.seat
        clock = int(seat.next_us - seat.autopilots.held_us[seat.i])
        row, why = self._references.command_from_ground(message, seat.autopilots.own[seat.i], clock)
        if why:
            self._complain(why)
            return
        self._heard()
        self.refused_target = ""
        if seat.autopilots.mode[seat.i] == OFFBOARD and tuple(row[1:]) != self._target:
            self._target = tuple(row[1:])
            seat.autopilots.reference_commands[seat.i, -1] = row

    def _position(self, message: Any) -> None:
        seat = self._link.seat
        altitude, speed, why = read_target(seat, message)
        if why:
            self._complain(why)
            return
        self._heard()
        wanted = (math.nan if altitude is None else altitude, math.nan if speed is None else speed)
        if seat.autopilots.mode[seat.i] == OFFBOARD:
            if repr(wanted) == repr(self._target):
                return
            self._target = wanted
            answer = lead(self._link, altitude, speed)
            if answer.result != ACCEPTED:
                self._complain(answer.text)
                return
        self.refused_target = ""

    def _complain(self, why: str) -> None:
        """Say once what is wrong with a target, whatever its numbers: they come many times a second."""
        before, self.refused_target = self.refused_target, why
        if _NUMBER.sub("", why) != _NUMBER.sub("", before):
            self._link.text(_M.MAV_SEVERITY_WARNING, why)
