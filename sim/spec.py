"""What a vehicle process is told at its start: plain, frozen, checked before."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import ACTUATORS
from ftcc.link.attitude_target import UNCODED, AttitudeCode
from ftcc.link.events import new_events
from ftcc.sim.faults import SPARE, inject
from ftcc.sim.navigation import NavigationFault
from ftcc.sim.obstacles import Obstacle, zones_of
from ftcc.sim.plant import TRUTH, Autothrottle, Disturbance, Fault, Fleet, Guards, Gust
from ftcc.sim.plants import find
from ftcc.sim.wind import NO_TURBULENCE, DiscreteGust, Turbulence, dryden, settled

__all__ = ["NO_AUTOTHROTTLE", "VehicleSpec", "build", "placeholder"]

NO_AUTOTHROTTLE = Autothrottle(0.0, 0.0, 0.0)


CALM = Gust()


@dataclass(frozen=True)
class VehicleSpec:
    """One vehicle."""

    uav: int
    kind: str
    """"aircraft", or "reference_point": the kinematic stand-in for a leader's aircraft."""
    plant: str
    """What the aircraft of the swarm are, see `plants`."""
    airframe: tuple[float, ...]
    """The plant's ``Parameters``."""
    initial: tuple[float, ...]
    """The plant's ``State``."""
    command: tuple[float, ...]
    """Command in force, and position of the actuators, before the first one arrives; order of ``ACTUATORS``."""
    limits: tuple[tuple[float, float], ...]
    lag: tuple[float, ...]
    """rad/s, 0 = none."""
    rate: tuple[float, ...]
    """Rate limit of each actuator, rad/s or N/s; inf = none."""
    fault_before_lag: bool
    faults: tuple[Fault, ...]
    disturbances: tuple[Disturbance, ...]
    noise: tuple[float, ...]
    """Standard deviation of each channel of ``TRUTH`` as measured."""
    guards: Guards
    offset: float
    """Lateral position at the start, m."""
    autothrottle: Autothrottle = NO_AUTOTHROTTLE
    damping: tuple[float, ...] = (0.0,) * len(ACTUATORS)
    """Of second-order actuators, below 1; 0 = first order."""
    delay: int = 0
    """Samples by which a command acts later than it has to."""
    holds_first: bool = False
    """Whether ``command`` stays in force for that delay; otherwise the first command received is in force at once."""
    gust: Gust = CALM
    discrete_gusts: tuple[DiscreteGust, ...] = ()
    turbulence: Turbulence = NO_TURBULENCE
    attitude_code: AttitudeCode = UNCODED
    """Whether and how commands come as attitude targets."""
    target: tuple[float, ...] = (0.0,) * 7
    """A `reference_point`'s first target: stamp s, x, y, z, vx, vy, vz."""
    navigation_faults: tuple[NavigationFault, ...] = ()
    datum: float = 0.0
    """Altitude from which that in the state's message counts, m."""
    obstacles: tuple[Obstacle, ...] = ()
    """The same for all vehicles."""

    @property
    def travel(self) -> tuple[float, ...]:
        """Full deflection of each actuator, by which commands are divided on the wire."""
        return tuple(max(abs(low), abs(high)) for low, high in self.limits)


def _padded(rows: Sequence[Sequence[tuple[float, ...]]], width: int) -> NDArray[np.float64]:
    table = np.zeros((len(rows), max([1] + [len(row) for row in rows]), width))
    table[:, :, 0] = math.inf
    for i, row in enumerate(rows):
        if row:
            table[i, : len(row)] = sorted(row)
    return table


def _free(specs: Sequence[VehicleSpec], name: str, width: int) -> NDArray[np.float64]:
    """An empty table of failures with room for the planned ones and `SPARE` others."""
    table = np.zeros((len(specs), SPARE + max(len(getattr(spec, name)) for spec in specs), width))
    table[:, :, 0] = math.inf
    return table


def build(specs: Sequence[VehicleSpec]) -> Fleet:
    """Arrays for ``specs``, which share one plant, before the first tick."""
    k = len(specs)
    plant = find(specs[0].plant)
    command = np.array([spec.command for spec in specs], np.float64)
    limits = np.array([spec.limits for spec in specs], np.float64)
    fleet = Fleet(
        state=np.array([spec.initial for spec in specs], np.float64),
        position=np.clip(command, limits[:, :, 0], limits[:, :, 1]),
        command=command,
        acting=np.zeros((k, len(ACTUATORS))),
        limits=limits,
        lag=np.array([spec.lag for spec in specs], np.float64),
        rate=np.array([spec.rate for spec in specs], np.float64),
        damping=np.array([spec.damping for spec in specs], np.float64),
        speed=np.zeros((k, len(ACTUATORS))),
        delayed=np.repeat(command[:, None, :], max(spec.delay for spec in specs), axis=1),
        waiting=np.array([spec.holds_first for spec in specs], np.int64),
        code=np.array([spec.attitude_code for spec in specs], np.float64),
        gust_deviation=np.array([spec.gust.deviation for spec in specs], np.float64),
        gust_period_us=np.array([spec.gust.period_us for spec in specs], np.int64),
        gust_seed=np.array([spec.gust.seed for spec in specs], np.int64),
        gusts=_padded([spec.discrete_gusts for spec in specs], len(DiscreteGust._fields)),
        dryden=np.array([dryden(spec.turbulence) for spec in specs]),
        turbulence=np.array([settled(spec.turbulence, spec.uav) for spec in specs]),
        still=np.array([int(not spec.discrete_gusts and spec.turbulence == NO_TURBULENCE) for spec in specs], np.int64),
        turbulence_seed=np.array([spec.turbulence.seed for spec in specs], np.int64),
        fault_before_lag=np.array([float(spec.fault_before_lag) for spec in specs]),
        faults=_free(specs, "faults", len(Fault._fields)),
        fault_count=np.zeros(k, np.int64),
        deflection=np.clip(command, limits[:, :, 0], limits[:, :, 1]),
        held=np.zeros((k, len(ACTUATORS))),
        held_since=np.full((k, len(ACTUATORS)), math.inf),
        navigation=_free(specs, "navigation_faults", len(NavigationFault._fields)),
        navigation_count=np.zeros(k, np.int64),
        solution=np.zeros((k, 13)),
        fresh=np.full((k, 2), -1.0),
        updates=np.zeros((k, 2), np.int64),
        disturbances=_padded([spec.disturbances for spec in specs], len(Disturbance._fields)),
        guards=np.array([spec.guards for spec in specs], np.float64),
        airframe=np.array([spec.airframe for spec in specs], np.float64),
        datum=np.array([spec.datum for spec in specs], np.float64),
        offset=np.array([spec.offset for spec in specs], np.float64),
        target=np.array([spec.target for spec in specs], np.float64),
        point=np.array([spec.kind == "reference_point" for spec in specs], np.int64),
        noise=np.array([spec.noise for spec in specs], np.float64).reshape(k, len(TRUTH)),
        uav=np.array([spec.uav for spec in specs], np.int64),
        travel=np.array([spec.travel for spec in specs], np.float64),
        zones=zones_of(specs[0].obstacles),
        entered=np.zeros((k, len(specs[0].obstacles)), np.int64),
        events=new_events(),
        autothrottle=np.array([(*spec.autothrottle, spec.autothrottle.thrust) for spec in specs], np.float64),
        disturbed=np.zeros((k, len(plant.DISTURBANCES))),
    )
    for i, spec in enumerate(specs):
        planned: list[Fault | NavigationFault] = [*spec.faults, *spec.navigation_faults]
        for fault in sorted(planned, key=lambda fault: fault.time):
            inject(fleet, i, fault, -math.inf)
    return fleet


def placeholder(plant: str) -> VehicleSpec:
    """A vehicle that flies nowhere, to compile with."""
    flown = find(plant)
    return VehicleSpec(
        uav=1,
        kind="aircraft",
        plant=plant,
        airframe=(1.0,) * len(flown.Parameters._fields),
        initial=(1.0,) * len(flown.State._fields),
        command=(0.0,) * len(ACTUATORS),
        limits=((0.0, 0.0),) * len(ACTUATORS),
        lag=(0.0,) * len(ACTUATORS),
        rate=(math.inf,) * len(ACTUATORS),
        fault_before_lag=False,
        faults=(),
        disturbances=(),
        noise=(0.0,) * len(TRUTH),
        guards=Guards(*(0.0,) * len(Guards._fields)),
        offset=0.0,
    )
