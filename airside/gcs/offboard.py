"""Offboard: targets from the ground. Which a UAV takes depends on what it tracks."""

from __future__ import annotations

import math
import re
import time
from typing import Any

from ftcc.airside.gcs.answers import ACCEPTED
from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.gcs.motion import command_leader, read_target
from ftcc.airside.gcs.outbox import Outbox
from ftcc.airside.references import of_plant
from ftcc.link.flight_modes import HOLD, OFFBOARD
from ftcc.link.mavlink import dialect

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

    def __init__(self, view: AutopilotView, outbox: Outbox) -> None:
        self._view = view
        self._outbox = outbox
        self._references = of_plant(view.scheme.plant)
        self._last = -math.inf
        """Wall time of the last target, s (monotonic)."""
        self._last_us = -_NEVER
        """Simulated time of the tick at which it could act, us."""
        self._target: tuple[float, ...] | None = None
        self.refused_target = ""
        """Why the last target was not taken; empty if it was."""

    @property
    def _takes_attitudes(self) -> bool:
        return not self._view.leader and hasattr(self._references, "command_from_ground")

    def refusal(self) -> str:
        """Why this UAV takes no targets; empty if it does."""
        return "" if self._view.leader or self._takes_attitudes else "offboard: this follower takes no targets"

    def is_fresh(self) -> bool:
        """Whether targets keep coming."""
        simulated = (self._view.next_us - self._last_us) / 1e6
        return min(simulated, time.monotonic() - self._last) < _FRESH

    def enter(self) -> None:
        """Offboard begins: the time without targets counts from now on."""
        self._last_us = self._view.next_us

    def release(self) -> None:
        """The UAV's own commands are in force again."""
        view = self._view
        if self._takes_attitudes:
            view.autopilots.reference_commands[view.i, -1] = math.inf
        self._target = None

    @property
    def running(self) -> bool:
        """Whether offboard ends if nothing comes."""
        view = self._view
        return bool(view.autopilots.mode[view.i] == OFFBOARD) and view.offboard_timeout > 0.0

    @property
    def next_us(self) -> int:
        """When it ends, simulated us."""
        return self._last_us + round(self._view.offboard_timeout * 1e6) if self.running else _NEVER

    def end_if_silent(self, now_us: int) -> None:
        """Fall back to hold where the targets have stopped."""
        if now_us < self.next_us:
            return
        view = self._view
        view.autopilots.mode[view.i] = HOLD
        self._outbox.send_text(_M.MAV_SEVERITY_WARNING, "no targets: offboard becomes hold")
        view.log("no targets from the ground: offboard becomes hold", "warning")

    def take_target(self, message: Any) -> None:
        """A target. In offboard it acts at once, before that it shows that targets are there."""
        why = self.refusal()
        by_attitude = message.get_type() == "SET_ATTITUDE_TARGET"
        if not why and by_attitude and not self._takes_attitudes:
            why = "a leader takes positions, no attitudes"
        elif not why and not by_attitude and not self._view.leader:
            why = "a follower takes attitudes, no positions"
        if why:
            self._warn_once(why)
        elif by_attitude:
            self._take_attitude(message)
        else:
            self._take_position(message)

    def _accept(self) -> None:
        """A target that makes sense has come."""
        self._last, self._last_us = time.monotonic(), self._view.next_us

    def _take_attitude(self, message: Any) -> None:
        view = self._view
        clock = int(view.next_us - view.autopilots.held_us[view.i])
        row, why = self._references.command_from_ground(message, view.autopilots.own[view.i], clock)
        if why:
            self._warn_once(why)
            return
        self._accept()
        self.refused_target = ""
        if view.autopilots.mode[view.i] == OFFBOARD and tuple(row[1:]) != self._target:
            self._target = tuple(row[1:])
            view.autopilots.reference_commands[view.i, -1] = row

    def _take_position(self, message: Any) -> None:
        view = self._view
        altitude, speed, why = read_target(view, message)
        if why:
            self._warn_once(why)
            return
        self._accept()
        wanted = (math.nan if altitude is None else altitude, math.nan if speed is None else speed)
        if view.autopilots.mode[view.i] == OFFBOARD:
            if repr(wanted) == repr(self._target):
                return
            self._target = wanted
            answer = command_leader(view, altitude, speed)
            if answer.result != ACCEPTED:
                self._warn_once(answer.text)
                return
        self.refused_target = ""

    def _warn_once(self, why: str) -> None:
        """Report once what is wrong with a target, whatever its numbers: they come many times a second."""
        before, self.refused_target = self.refused_target, why
        if _NUMBER.sub("", why) != _NUMBER.sub("", before):
            self._outbox.send_text(_M.MAV_SEVERITY_WARNING, why)
