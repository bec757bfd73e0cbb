"""Targets from the ground: which a UAV takes depends on what it refers to."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

from ftcc.airside.ground.commands import ACCEPTED, lead, set_mode
from ftcc.airside.references import of_plant
from ftcc.link.mavlink import as_typed, dialect
from ftcc.link.modes import HOLD, OFFBOARD

if TYPE_CHECKING:
    from ftcc.airside.ground.link import GroundLink

__all__ = ["Offboard"]

_M = dialect
_FRESH = 1.0
"""Wall time for which a target lets a UAV enter offboard, s."""


class Offboard:
    """Targets from the ground for one UAV.

    A leader takes altitude and speed (SET_POSITION_TARGET_LOCAL_NED). A follower takes an attitude
    (SET_ATTITUDE_TARGET) where the reference of its plant is one: the module then has ``command_from_ground``.
    Without targets for as long as COM_OF_LOSS_T says offboard becomes hold.
    """

    def __init__(self, link: GroundLink) -> None:
        self._link = link
        self._references = of_plant(link.seat.scheme.plant)
        self._last = -math.inf
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
        return time.monotonic() - self._last < _FRESH

    def release(self) -> None:
        """The UAV's own commands are in force again."""
        seat = self._link.seat
        if self._takes_attitudes:
            seat.autopilots.reference_commands[seat.i, -1] = math.inf
        self._target = None

    def attend(self) -> None:
        """Fall back where the targets have stopped."""
        seat = self._link.seat
        silent = time.monotonic() - self._last
        if seat.autopilots.mode[seat.i] == OFFBOARD and 0.0 < seat.patience < silent:
            set_mode(self._link, HOLD)
            self._link.text(_M.MAV_SEVERITY_WARNING, "no targets: offboard becomes hold")
            seat.note("no targets from the ground: offboard becomes hold", "warning")

    def take(self, message: Any) -> None:
        """A target. In offboard it acts at once, before that it shows that targets are there."""
        if self.refused():
            return
        if message.get_type() == "SET_ATTITUDE_TARGET":
            self._attitude(message)
        elif message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            self._position(message)

    def _attitude(self, message: Any) -> None:
        seat = self._link.seat
        if not self._takes_attitudes:
            return
        clock = int(seat.next_us - seat.autopilots.held_us[seat.i])
        row, why = self._references.command_from_ground(message, seat.autopilots.own[seat.i], clock)
        if why:
            self._complain(why)
            return
        self._last, self.refused_target = time.monotonic(), ""
        if seat.autopilots.mode[seat.i] == OFFBOARD and tuple(row[1:]) != self._target:
            self._target = tuple(row[1:])
            seat.autopilots.reference_commands[seat.i, -1] = row

    def _position(self, message: Any) -> None:
        seat = self._link.seat
        if not seat.leader:
            return
        asks = ~message.type_mask
        altitude = as_typed(-message.z) if asks & _M.POSITION_TARGET_TYPEMASK_Z_IGNORE else None
        speed = as_typed(message.vx) if asks & _M.POSITION_TARGET_TYPEMASK_VX_IGNORE else None
        # A client that asks for nothing in a field may put nan there, or a zero velocity.
        altitude = altitude if altitude is not None and math.isfinite(altitude) else None
        speed = speed if speed is not None and math.isfinite(speed) and speed > 0.0 else None
        if message.coordinate_frame != _M.MAV_FRAME_LOCAL_NED or (altitude is None and speed is None):
            self._complain("target: local NED with altitude or forward speed")
            return
        self._last, self.refused_target = time.monotonic(), ""
        wanted = (math.nan if altitude is None else altitude, math.nan if speed is None else speed)
        if seat.autopilots.mode[seat.i] == OFFBOARD and repr(wanted) != repr(self._target):
            answer = lead(self._link, altitude, speed)
            self._target = wanted
            if answer.result != ACCEPTED:
                self._complain(answer.text)

    def _complain(self, why: str) -> None:
        """Say once what is wrong with a target: they come many times a second."""
        if why != self.refused_target:
            self.refused_target = why
            self._link.text(_M.MAV_SEVERITY_WARNING, why)
