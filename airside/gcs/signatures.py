"""Signatures on an autopilot's links to the ground: its key, what it has heard, and who is refused, told in time."""

from __future__ import annotations

import time

from ftcc.airside.gcs.seat import Seat
from ftcc.link.codec import Codec
from ftcc.link.mavlink import AUTOPILOT
from ftcc.link.signing import Refusal, Signing, read_key, stamps_file

__all__ = ["Signatures"]

_AGAIN = 60.0
"""Wall time after which the same refusal is told again, s."""
_SENDERS = 64
"""Refusals of so many senders and reasons are told apart; ids are easily forged."""


class Signatures:
    """What one autopilot does about signatures; nothing, where its links are not signed."""

    def __init__(self, seat: Seat, system: int) -> None:
        self._seat = seat
        self.signing: Signing | None = None
        key = seat.setting.key
        if key is not None:
            self.signing = Signing(read_key(key), stamps_file(key, system, AUTOPILOT))
        self._told: dict[tuple[str, int, int], float] = {}
        """When each refusal was told last, wall s (monotonic), by reason and sender."""
        self._forgetful = False

    def remember(self) -> None:
        """Write down what has been heard; where that is impossible it is told once, and the flight goes on."""
        if self.signing is None:
            return
        try:
            self.signing.remember()
        except OSError as error:
            if not self._forgetful:
                self._forgetful = True
                self._seat.note(
                    f"time stamps of signed messages cannot be kept ({error.strerror or error}): "
                    "after a restart what was heard before could be repeated",
                    "warning",
                )

    def tell(self, codec: Codec) -> None:
        """Have the first refusal of each reason and sender logged, and then one a minute."""
        for refusal in codec.take_refusals():
            self._tell(refusal)

    def _tell(self, refusal: Refusal) -> None:
        key, now = (refusal.reason, refusal.system, refusal.component), time.monotonic()
        last = self._told.get(key)
        if (last is None and len(self._told) == _SENDERS) or (last is not None and now - last < _AGAIN):
            return
        self._told[key] = now
        who = f"{refusal.system}/{refusal.component}"
        self._seat.note(f"refused: {refusal.text}", "warning", who, "denied")
