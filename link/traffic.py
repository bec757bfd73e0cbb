"""What the real network does to one link of the mesh: how late transmissions come, how many never do, how long none."""

from __future__ import annotations

import threading
import time

__all__ = ["Traffic"]


class Traffic:
    """Counts since the last report; noted in one thread, reported in another."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._last: float | None = None
        self._number = -1
        self._clear()

    def _clear(self) -> None:
        self._received = self._missing = 0
        self._delays = self._longest = self._silence = 0.0

    def arrived(self, sent_ns: int) -> None:
        """Note a transmission that was sent at this Unix time, ns, and has come now."""
        now, delay = time.monotonic(), (time.time_ns() - sent_ns) / 1e9
        with self._lock:
            self._received += 1
            self._delays += delay
            self._longest = max(self._longest, delay)
            self._silence = max(self._silence, now - (now if self._last is None else self._last))
            self._last = now

    def numbered(self, number: int) -> None:
        """Note the number of a transmission, in order: what is between it and the last one is missing."""
        with self._lock:
            if self._number >= 0:
                self._missing += max(0, number - self._number - 1)
            self._number = max(self._number, number)

    def report(self) -> tuple[int, int, float, float, float]:
        """Received and missing transmissions, mean and longest delay (s), longest silence (s); begins anew."""
        with self._lock:
            now = time.monotonic()
            mean = self._delays / self._received if self._received else 0.0
            if self._last is None:  # nothing has come since the flight began: silence counts from here on
                self._last = now
            silence = max(self._silence, now - self._last)
            found = (self._received, self._missing, mean, self._longest, silence)
            self._clear()
            return found
