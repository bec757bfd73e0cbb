"""What the handlers of commands and of other messages work with."""

from __future__ import annotations

from dataclasses import dataclass

from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.gcs.failures import Failures
from ftcc.airside.gcs.offboard import Offboard
from ftcc.airside.gcs.outbox import Outbox
from ftcc.airside.gcs.parameters import Parameters
from ftcc.airside.gcs.telemetry import Telemetry

__all__ = ["Services"]


@dataclass(frozen=True)
class Services:
    """The parts of one autopilot's side towards the ground."""

    view: AutopilotView
    outbox: Outbox
    telemetry: Telemetry
    parameters: Parameters
    failures: Failures
    offboard: Offboard
