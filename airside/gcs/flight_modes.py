"""Changes of an autopilot's mode, whoever asks for them: a command, a message, or targets that stop coming."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ftcc.airside.gcs.answers import ACCEPTED, BUSY, DENIED, Answer
from ftcc.airside.references.profiles import release_from_ground
from ftcc.link.flight_modes import MISSION, NAMES, OFFBOARD

if TYPE_CHECKING:
    from ftcc.airside.gcs.gcs_link import GcsLink

__all__ = ["set_mode"]


def set_mode(link: GcsLink, mode: int) -> Answer:
    """Change the mode; to set the present one again does nothing."""
    seat = link.seat
    if mode == seat.autopilots.mode[seat.i]:
        return Answer(ACCEPTED)
    if mode == OFFBOARD:
        why = link.offboard.refused()
        if why:
            return Answer(DENIED, why)
        if not link.offboard.fresh():
            return Answer(BUSY, link.offboard.refused_target or "offboard: send targets first")
        link.offboard.enter()
    if mode == MISSION and seat.leader:
        release_from_ground(seat.autopilots.profile_commands[seat.i])
    if mode == MISSION:
        link.offboard.release()
    seat.autopilots.mode[seat.i] = mode
    return Answer(ACCEPTED, event=f"mode {NAMES[mode]}")
