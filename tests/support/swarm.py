"""The reference swarm of chapter 5 in one process, built by hand: six followers, two leaders, no scenario file.

Run as a program it prints a digest of a short flight, for comparisons between processes.
"""

from __future__ import annotations

import hashlib
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np

from ftcc.airside.autopilots import Autopilots
from ftcc.airside.model import Model
from ftcc.airside.references.profiles import Command, Cosine, Profile
from ftcc.airside.scheme import Scheme
from ftcc.airside.schemes import find
from ftcc.airside.spec import AutopilotSpec, LinkEvent, Neighbour, OwnReference
from ftcc.groundside.simulation.flight_arrays import new_world
from ftcc.groundside.simulation.one_process import loop_of
from ftcc.link.actuators import ACTUATORS
from ftcc.link.channel import Channel, Inbox
from ftcc.link.graph import Graph
from ftcc.link.timing import Timing
from ftcc.sim.airframe import Airframe
from ftcc.sim.disturbances import Disturbance
from ftcc.sim.faults import Fault
from ftcc.sim.fleet import Fleet
from ftcc.sim.plant import TRUTH, Guards
from ftcc.sim.plants import conditions_of
from ftcc.sim.spec import VehicleSpec

AIRFRAME = Airframe(
    m=25.0, S=1.463, c=0.451, Iy=6.765, rho=1.205, g=9.8,
    CD0=0.0225, CDa=0.1002, CDa2=1.0778, CL0=0.2153, CLa=4.6333, CLde=0.2865,
    Cm0=-0.0954, Cma=-2.8206, Cmde=-0.9455, Cmq=-13.8189,
    b=3.25, Ix=2.56, Iz=8.60, Ixz=0.35, CY0=0.0, CYb=-0.38,
    Cl0=0.0, Clb=-0.035, Clda=-0.068, Cldr=0.004, Clp=-0.40, Clr=0.070,
    Cn0=0.0, Cnb=0.0867, Cnda=0.004, Cndr=-0.0534, Cnp=-0.03, Cnr=-0.214,
)  # fmt: skip
"""The reference airframe."""


def nominal(*, thrust: float = 40.0, elevator: float = 0.7, lag: float = 20.0, sideways: float = 0.0) -> Model:
    """What a law knows of it: limits of 0 .. ``thrust`` N and +-``elevator``, +-``sideways`` rad, ``lag`` in rad/s."""
    return Model(
        **AIRFRAME._asdict(),
        thrust_min=0.0, thrust_max=thrust, elevator_min=-elevator, elevator_max=elevator, lag=lag,
        aileron_min=-sideways, aileron_max=sideways, rudder_min=-sideways, rudder_max=sideways,
    )  # fmt: skip


TRIM = (0.0, -0.19688, 0.0, 21.303)
"""Command in level flight at 30 m/s, in the order of ``ACTUATORS``; the angle of attack there is 0.03217 rad."""

LIMITS = ((0.0, 0.0), (-0.7, 0.7), (0.0, 0.0), (0.0, 40.0))
"""Table 5.1."""

FOLLOWERS, LEADERS = (1, 2, 3, 4, 5, 6), (7, 8)

_BOTH_WAYS = {(1, 2): 0.4, (1, 6): 0.5, (2, 3): 0.2, (3, 4): 0.3, (3, 5): 0.2, (4, 5): 0.2, (5, 6): 0.3}
WEIGHTS = (
    _BOTH_WAYS | {(j, i): weight for (i, j), weight in _BOTH_WAYS.items()} | {(1, 7): 0.9, (6, 7): 0.2, (4, 8): 0.8}
)
"""Eq. (5.50): (receiver, sender) -> a_ij."""

GRAPH = Graph(FOLLOWERS, LEADERS, WEIGHTS)

SCENARIO_DISTURBANCES = tuple(Disturbance(50.0, channel, value, 0.0) for channel, value in enumerate((0.2, 0.2, 0.1)))
"""Eq. (5.51)."""


LEADER = (0.0, 0.0, 0.0, 1000.0, 30.0, 0.0, 0.0)
"""First target of a `reference_point`."""


def vehicle(uav: int = 1, **changes: Any) -> VehicleSpec:
    """A follower's aircraft in level trim at 30 m/s and 1000 m, without lag, faults, disturbances and noise."""
    standard: dict[str, Any] = {
        "uav": uav,
        "kind": "aircraft",
        "plant": "longitudinal",
        "airframe": AIRFRAME,
        "initial": (30.0, 0.0, 1000.0, 0.0, 0.0322, 0.0),
        "command": TRIM,
        "limits": LIMITS,
        "lag": (0.0,) * len(ACTUATORS),
        "rate": (math.inf,) * len(ACTUATORS),
        "fault_before_lag": False,
        "faults": (),
        "disturbances": (),
        "noise": (0.0,) * len(TRUTH),
        "guards": Guards(3.0, 1.5, 1.5, 1.4),
        "offset": 0.0,
    }
    return VehicleSpec(**standard | changes)


def noise(**deviations: float) -> tuple[float, ...]:
    """Standard deviations by channel, in the order of ``TRUTH``."""
    return tuple(deviations.get(name, 0.0) for name in TRUTH)


def profile(uav: int) -> Profile:
    """Commanded motion of leader 7 or 8, eqs. (5.54)-(5.55)."""
    climb = (Command(15.0, 1100.0, 30.0),) if uav == 7 else ()
    return Profile(0.0, 1000.0, 30.0, climb, cosine=Cosine(150.0, 60.0, 0.02))


def autopilot(uav: int = 1, form: str = "flight", **changes: Any) -> AutopilotSpec:
    """The autopilot of a UAV of the reference swarm under the containment law."""
    scheme = find("containment")
    leader = uav in LEADERS
    standard: dict[str, Any] = {
        "uav": uav,
        "role": "leader" if leader else "follower",
        "scheme": "containment",
        "gains": tuple(scheme.gains(form, {})),
        "model": nominal(),
        "command": vehicle().command,
        "travel": vehicle().travel,
        "reference": OwnReference((0.0, 30.0, 0.0, 0.0, 0.0, 0.0, 30.0)),
        "neighbours": tuple(Neighbour(j, WEIGHTS[uav, j]) for j in GRAPH.senders(uav)),
        "channel": Channel(),
        "profile": profile(uav) if leader else None,
    }
    return AutopilotSpec(**standard | changes)


def timing(form: str, seconds: float, seed: int = 1) -> Timing:
    """100 Hz control and 20 Hz exchange, or the ideal exchange of the monograph at 1 ms; every tick is recorded."""
    if form == "flight":
        return Timing(10_000, 50_000, 50_000, 1000, round(seconds * 100), 1, seed)
    return Timing(1000, 1000, 0, 1000, round(seconds * 1000), 1, seed)


PERFECT, QUIET = Channel(), noise()


@dataclass
class Swarm:
    """The reference swarm before or in flight."""

    form: str
    seconds: float
    seed: int = 1
    lag: float | None = None
    """Bandwidth of elevator and thrust, rad/s; default 20 in the flight form, none in the monograph's."""
    start: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    """Initial (V, x, z, gamma, theta, q) of single followers."""
    gains: Mapping[str, float] = field(default_factory=dict)
    channel: Channel = PERFECT
    noise: tuple[float, ...] = QUIET
    faults: Mapping[int, tuple[Fault, ...]] = field(default_factory=dict)
    disturbances: tuple[Disturbance, ...] = ()
    link_events: Mapping[int, tuple[LinkEvent, ...]] = field(default_factory=dict)

    fleet: Fleet = field(init=False)
    autopilots: Autopilots = field(init=False)
    inbox: Inbox = field(init=False)
    recording: Any = field(init=False)

    def __post_init__(self) -> None:
        self.timing = timing(self.form, self.seconds, self.seed)
        lag = self.lag if self.lag is not None else (20.0 if self.form == "flight" else 0.0)
        level = (30.0, 0.0, 1000.0, 0.0, 0.0322, 0.0)
        vehicles = [
            vehicle(
                uav,
                initial=self.start.get(uav, level),
                lag=(lag,) * len(ACTUATORS),
                faults=self.faults.get(uav, ()),
                disturbances=self.disturbances,
                noise=self.noise,
            )
            for uav in FOLLOWERS
        ] + [vehicle(uav, kind="reference_point", target=LEADER) for uav in LEADERS]
        gains = tuple(self.scheme.gains(self.form, self.gains))
        specs = [
            autopilot(uav, gains=gains, channel=self.channel, link_events=self.link_events.get(uav, ()))
            for uav in GRAPH.uavs
        ]
        self.world = new_world(vehicles, specs, self.timing, len(conditions_of("longitudinal")))
        self.fleet, self.autopilots, self.inbox = self.world.fleet, self.world.autopilots, self.world.inbox
        self.events, self.exchange, self.recording = self.world.events, self.world.exchange, self.world.recording

    @property
    def scheme(self) -> Scheme:
        return find("containment")

    @property
    def loop(self) -> ModuleType:
        """The compiled flight loop of the scheme."""
        return loop_of("containment", "longitudinal")

    def fly(self, first: int = 0, last: int | None = None) -> Swarm:
        """Fly the ticks first..last-1, by default all."""
        end = self.timing.ticks + 1 if last is None else last
        fly = self.loop.fly_by_wire if self.form == "flight" else self.loop.fly_ideally
        fly(self.world, self.timing, first, end)
        return self

    @property
    def t(self) -> np.ndarray:
        """Times of the recorded rows, s."""
        return np.arange(self.timing.ticks + 1) * self.timing.period

    def truth(self, name: str) -> np.ndarray:
        """A true state of all UAVs, shape (rows, 8)."""
        return self.recording.truth[:, :, TRUTH.index(name)]

    def signal(self, name: str) -> np.ndarray:
        """A signal of the followers' laws, shape (rows, 6)."""
        index = [quantity.name for quantity in self.scheme.signals].index(name)
        return self.recording.signals[:, : len(FOLLOWERS), index]

    @property
    def digest(self) -> str:
        """Hash of every bit of the recording."""
        hashed = hashlib.sha256()
        for array in (part for part in self.recording if isinstance(part, np.ndarray)):
            hashed.update(np.ascontiguousarray(array).tobytes())
        return hashed.hexdigest()


def busy(form: str, seconds: float, seed: int = 1) -> Swarm:
    """A short flight in which everything happens: offsets, noise, loss, jitter, a cut, a fault and disturbances."""
    return Swarm(
        form,
        seconds,
        seed,
        start={1: (29.5, 0.0, 1000.5, 0.01, 0.05, 0.01)},
        gains={"in_flight": 1.0},
        channel=Channel(loss=0.3, burst_start=0.1, burst_end=0.5, delay=0.01, jitter=0.05),
        noise=noise(V=0.01, z=0.02, gamma=2e-4, theta=2e-4, q=5e-4),
        faults={1: (Fault(0.2 * seconds, 1, 0.7, 0.1, 0.0, 5.0),)},
        disturbances=tuple(Disturbance(0.3 * seconds, channel, 0.05, 2.0) for channel in range(3)),
        link_events={4: (LinkEvent(round(5e5 * seconds), 8, Channel(blocked=1.0)),)},
    )


if __name__ == "__main__":
    flight = busy(sys.argv[1], float(sys.argv[2])).fly()
    assert not flight.recording.lost.any(), flight.recording.lost
    assert np.isfinite(flight.recording.truth).all()
    print(flight.digest)
