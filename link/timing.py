"""The time grid that all processes of a run share. Simulated times are whole microseconds."""

from __future__ import annotations

from typing import NamedTuple

from ftcc.link.compiled import compiled

__all__ = ["Timing", "tick_of", "ticks_a_second"]


@compiled
def ticks_a_second(period_us):
    """Ticks in a second, as nearly as the period allows."""
    return max(1, round(1e6 / period_us))


@compiled
def tick_of(stamp_us, period_us):
    """The tick whose time, rounded down to whole ms, is ``stamp_us``; -1 if there is none.

    MAVLink's time_boot_ms is the time rounded down. As long as a period is at least 1 ms, no two ticks share a ms: the
    tick is unique, and its time is tick * period, not the stamp.
    """
    tick = (stamp_us + period_us - 1) // period_us
    return tick if stamp_us >= 0 and tick * period_us // 1000 == stamp_us // 1000 else -1


class Timing(NamedTuple):
    """Periods of a run; tick k is at time k * period. Compiled code reads the fields."""

    period_us: int
    """Control period."""
    exchange_us: int
    """Period of the neighbours' records, a multiple of the control period."""
    latency_us: int
    """Link latency: a record stamped t is usable from t + latency on."""
    step_us: int
    """Integration step of the plant."""
    ticks: int
    """The last tick."""
    record_every: int
    """Ticks between recorded rows."""
    seed: int

    @property
    def period(self) -> float:
        """Control period, s."""
        return self.period_us / 1e6

    @property
    def exchange_every(self) -> int:
        """Ticks between records to the neighbours."""
        return self.exchange_us // self.period_us

    @property
    def report_every(self) -> int:
        """Ticks between recorded rows of links: a second, as nearly as the period allows."""
        return int(ticks_a_second(self.period_us))

    @property
    def duration(self) -> float:
        """s."""
        return self.ticks * self.period_us / 1e6
