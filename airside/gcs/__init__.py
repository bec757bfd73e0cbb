"""What an autopilot is to the ground: a MAVLink vehicle that sends telemetry, answers and obeys."""

from __future__ import annotations

from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.gcs.commands import COMMANDS
from ftcc.airside.gcs.gcs_link import GcsLink
from ftcc.airside.gcs.requests import MESSAGES
from ftcc.airside.gcs.streams import BELIEF_FIELDS, LINK_FIELDS

__all__ = ["BELIEF_FIELDS", "COMMANDS", "LINK_FIELDS", "MESSAGES", "AutopilotView", "GcsLink"]
