"""Changes of an autopilot's flight mode that the ground asks for, by a command or a message."""

from __future__ import annotations

from ftcc.airside.gcs.answers import ACCEPTED, BUSY, DENIED, Answer
from ftcc.airside.gcs.services import Services
from ftcc.airside.references.profiles import release_from_ground
from ftcc.link.flight_modes import MISSION, NAMES, OFFBOARD

__all__ = ["set_mode"]


def set_mode(services: Services, mode: int) -> Answer:
    """Change the mode; to set the present one again does nothing."""
    view, offboard = services.view, services.offboard
    if mode == view.autopilots.mode[view.i]:
        return Answer(ACCEPTED)
    if mode == OFFBOARD:
        why = offboard.refusal()
        if why:
            return Answer(DENIED, why)
        if not offboard.is_fresh():
            return Answer(BUSY, offboard.refused_target or "offboard: send targets first")
        offboard.enter()
    if mode == MISSION and view.leader:
        release_from_ground(view.autopilots.profile_commands[view.i])
    if mode == MISSION:
        offboard.release()
    view.autopilots.mode[view.i] = mode
    return Answer(ACCEPTED, event=f"mode {NAMES[mode]}")
