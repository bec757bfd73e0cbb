"""What an autopilot is to the ground: a MAVLink vehicle that tells, answers and obeys."""

from __future__ import annotations

from ftcc.airside.ground.commands import COMMANDS
from ftcc.airside.ground.link import GroundLink
from ftcc.airside.ground.requests import MESSAGES
from ftcc.airside.ground.seat import Home, Seat
from ftcc.airside.ground.streams import LINK_FIELDS

__all__ = ["COMMANDS", "LINK_FIELDS", "MESSAGES", "GroundLink", "Home", "Seat"]
