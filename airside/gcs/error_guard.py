"""Errors of this software in what the ground asks for: caught in one place, so that the flight goes on."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable

from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.link.gate import LauncherGoneError

__all__ = ["ErrorGuard"]


class ErrorGuard:
    """Runs what may raise; an error is counted, and the first of each kind logged."""

    def __init__(self, view: AutopilotView) -> None:
        self._view = view
        self.errors: Counter[str] = Counter()
        """What failed here, and how often."""

    def run(self, what: str, do: Callable[[], None]) -> None:
        """Call ``do``; only the end of the launcher is raised further."""
        try:
            do()
        except LauncherGoneError:
            raise
        except Exception as error:
            self.errors[what] += 1
            if self.errors[what] == 1:
                traceback.print_exc()
                self._view.log(f"{what} failed, a fault of this software: {error!r}", "error")
