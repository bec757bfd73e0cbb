"""Signatures on an autopilot's links to the ground: its key, what it has heard, and whose messages are refused."""

from __future__ import annotations

import time

from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.link.codec import Codec
from ftcc.link.mavlink import AUTOPILOT
from ftcc.link.signing import Refusal, Signing, read_key, stamps_file

__all__ = ["Signatures"]

_AGAIN = 60.0
"""Wall time after which the same refusal is logged again, s."""
_SENDERS = 64
"""Refusals of so many senders and reasons are distinguished; ids are easily forged."""


class Signatures:
    """What one autopilot does about signatures; nothing, where its links are not signed."""

    def __init__(self, view: AutopilotView, system: int) -> None:
        self._view = view
        self.signing: Signing | None = None
        key = view.setting.key
        if key is not None:
            self.signing = Signing(read_key(key), stamps_file(key, system, AUTOPILOT))
        self._logged: dict[tuple[str, int, int], float] = {}
        """When each refusal was logged last, wall s (monotonic), by reason and sender."""
        self._cannot_keep = False

    def remember(self) -> None:
        """Write down what has been heard; where that is impossible it is logged once, and the flight goes on."""
        if self.signing is None:
            return
        try:
            self.signing.remember()
        except OSError as error:
            if not self._cannot_keep:
                self._cannot_keep = True
                self._view.log(
                    f"time stamps of signed messages cannot be kept ({error.strerror or error}): "
                    "after a restart what was heard before could be repeated",
                    "warning",
                )

    def log_refusals(self, codec: Codec) -> None:
        """Log the first refusal of each reason and sender, and then one a minute."""
        for refusal in codec.take_refusals():
            self._log(refusal)

    def _log(self, refusal: Refusal) -> None:
        key, now = (refusal.reason, refusal.system, refusal.component), time.monotonic()
        last = self._logged.get(key)
        if (last is None and len(self._logged) == _SENDERS) or (last is not None and now - last < _AGAIN):
            return
        self._logged[key] = now
        who = f"{refusal.system}/{refusal.component}"
        self._view.log(f"refused: {refusal.text}", "warning", who, "denied")
