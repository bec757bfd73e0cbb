"""All that the modules of this package see of an autopilot and may change: one among those of its process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.attacks.arrays import Attacks
from ftcc.airside.autopilots import Autopilots
from ftcc.airside.defence.arrays import ON
from ftcc.airside.link_events import LinkEvents
from ftcc.airside.scheme import Scheme
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.channel import Channel, Inbox
from ftcc.link.gate import EventReport
from ftcc.link.home import Home
from ftcc.link.mavlink import Endpoint
from ftcc.link.process import Setting
from ftcc.link.text import as_seconds

__all__ = ["AutopilotView"]


@dataclass
class AutopilotView:
    """One autopilot: its row of the arrays, its vehicle, and its way to the launcher's log."""

    spec: AutopilotSpec
    i: int
    """Its row."""
    setting: Setting
    scheme: Scheme
    autopilots: Autopilots
    inbox: Inbox
    link_events: LinkEvents
    attacks: Attacks
    state: NDArray[np.float64]
    """(13,): the vehicle's last state, as its messages bring it."""
    controls: NDArray[np.float64]
    """(4,): the last command, fractions of travel."""
    vehicle: Endpoint
    send_to_launcher: Callable[[EventReport], None]
    done: NDArray[np.int64]
    """(1,): its last tick; -1 before the first."""
    alive: bool = True
    failure_sizes: dict[str, float] = field(default_factory=dict)
    """Parameters FAIL_*: how large the next failure is."""
    attack_sizes: dict[str, float] = field(default_factory=dict)
    """Parameters ATK_*: what the next lie is."""
    at_ms: int = 0
    """Parameter FTCC_AT: simulated time at which failures and leaders' commands act, ms; 0 = now."""
    offboard_timeout: float = 1.0
    """Parameter COM_OF_LOSS_T: simulated time without targets after which offboard becomes hold, s; 0 = never."""
    takeoff_altitude: float = 10.0
    """Parameter MIS_TAKEOFF_ALT, m: without effect."""
    failures_enabled: int = 1
    """Parameter SYS_FAILURE_EN."""
    fault_tolerance: bool = True
    """Parameter FTCC_FT."""

    def __post_init__(self) -> None:
        self.channel: Channel = self.spec.channel
        """Parameters CH_*: quality of the edges by which this UAV hears, where nothing has failed."""

    @property
    def leader(self) -> bool:
        """Whether it is a leader's."""
        return self.spec.role == "leader"

    @property
    def diagnosed(self) -> bool:
        """Whether it diagnoses its own actuators."""
        diagnosis = self.autopilots.diagnosis
        return diagnosis is not None and bool(diagnosis.on[self.i])

    @property
    def defended(self) -> bool:
        """Whether it defends itself against what neighbours tell."""
        return not self.leader and bool(self.autopilots.defence.switches[ON])

    @property
    def home(self) -> Home:
        """Where the swarm flies."""
        return Home(*self.setting.home)

    @property
    def now_us(self) -> int:
        """Simulated time of the last tick."""
        return max(0, int(self.done[0])) * self.setting.timing.period_us

    @property
    def next_us(self) -> int:
        """Simulated time of the next tick, the earliest at which anything can act."""
        return (int(self.done[0]) + 1) * self.setting.timing.period_us

    def acting_time(self) -> tuple[int, str]:
        """When a request of now acts by FTCC_AT, us, or why it cannot."""
        at_us = self.at_ms * 1000
        if at_us == 0:
            return self.next_us, ""
        if at_us < self.next_us:
            return 0, f"FTCC_AT {self.at_ms} ms is past"
        if at_us > self.setting.timing.ticks * self.setting.timing.period_us:
            return 0, f"FTCC_AT {self.at_ms} ms: after the end"
        return at_us, ""

    def if_later(self, at_us: int) -> str:
        """ " at t = ..." where something does not act at once."""
        return f" at t = {as_seconds(at_us)} s" if at_us > self.next_us else ""

    def log(
        self, text: str, severity: str = "info", who: str = "", outcome: str = "", at_us: int | None = None
    ) -> None:
        """Have the launcher log an event and show it on the ground; without ``at_us`` it is one of the last tick."""
        when = self.now_us if at_us is None else at_us
        self.send_to_launcher(EventReport(severity, text, self.spec.uav, when, who, outcome))
