"""The arrays of a fleet, made of the specifications of its vehicles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import ACTUATORS
from ftcc.link.events import new_events
from ftcc.link.messages import StateMessage
from ftcc.sim.disturbances import Disturbance
from ftcc.sim.faults import Fault
from ftcc.sim.fleet import Fleet
from ftcc.sim.injection import SPARE, inject
from ftcc.sim.jsbsim.flight import Driven, start_models
from ftcc.sim.navigation import NavigationFault
from ftcc.sim.obstacles import zones_of
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import find
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.turning_air import begin, filters, turns
from ftcc.sim.wind import NO_TURBULENCE, DiscreteGust, dryden, settled

__all__ = ["build_fleet"]


def _padded(rows: Sequence[Sequence[tuple[float, ...]]], width: int) -> NDArray[np.float64]:
    table = np.zeros((len(rows), max([1] + [len(row) for row in rows]), width))
    table[:, :, 0] = math.inf
    for i, row in enumerate(rows):
        if row:
            table[i, : len(row)] = sorted(row)
    return table


def _empty_table(specs: Sequence[VehicleSpec], name: str, width: int) -> NDArray[np.float64]:
    """A table of faults without any, with room for the planned ones and `SPARE` others."""
    table = np.zeros((len(specs), SPARE + max(len(getattr(spec, name)) for spec in specs), width))
    table[:, :, 0] = math.inf
    return table


def _driven_at_start(spec: VehicleSpec, plant: ModuleType) -> Sequence[float]:
    """What a vehicle's external model gets at the start, see `Driven`; zeros without one."""
    if spec.flown is None:
        return (0.0,) * len(Driven._fields)
    calm = plant.Disturbances(*(0.0,) * len(plant.DISTURBANCES))
    begin = plant.State(*spec.initial), plant.Inputs(*spec.command), calm, plant.Parameters(*spec.airframe)
    return tuple(plant.driven(*begin))


def build_fleet(specs: Sequence[VehicleSpec]) -> Fleet:
    """The fleet of ``specs``, which share one plant, before the first tick."""
    k = len(specs)
    plant = find(specs[0].plant)
    command = np.array([spec.command for spec in specs], np.float64)
    limits = np.array([spec.limits for spec in specs], np.float64)
    state = np.array([spec.initial for spec in specs], np.float64)
    airs = [spec.turbulence for spec in specs]
    gusts = [settled(air, spec.uav) for spec, air in zip(specs, airs, strict=True)]
    driven = np.array([_driven_at_start(spec, plant) for spec in specs])
    fleet = Fleet(
        state=state,
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
        dryden=np.array([dryden(air) for air in airs]),
        turbulence=np.array(gusts),
        turns=np.array([int(turns(air.turning)) for air in airs], np.int64),
        turning=np.array([filters(air.turning, air.deviation, air.bandwidth, air.step_us) for air in airs]),
        turned=np.array(
            [
                begin(air.turning, air.bandwidth, air.seed, spec.uav, states)
                for spec, air, states in zip(specs, airs, gusts, strict=True)
            ]
        ),
        still=np.array([int(not spec.discrete_gusts and spec.turbulence == NO_TURBULENCE) for spec in specs], np.int64),
        turbulence_seed=np.array([spec.turbulence.seed for spec in specs], np.int64),
        fault_before_lag=np.array([float(spec.fault_before_lag) for spec in specs]),
        faults=_empty_table(specs, "faults", len(Fault._fields)),
        fault_count=np.zeros(k, np.int64),
        deflection=np.clip(command, limits[:, :, 0], limits[:, :, 1]),
        held=np.zeros((k, len(ACTUATORS))),
        held_since=np.full((k, len(ACTUATORS)), math.inf),
        navigation=_empty_table(specs, "navigation_faults", len(NavigationFault._fields)),
        navigation_count=np.zeros(k, np.int64),
        solution=np.zeros((k, len(StateMessage._fields))),
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
        autothrottle=np.array([spec.autothrottle for spec in specs], np.float64),
        speed_hold=np.array([spec.autothrottle.thrust for spec in specs], np.float64),
        disturbed=np.zeros((k, len(plant.Disturbances._fields))),
        driven=driven,
        model=start_models([spec.flown for spec in specs], [spec.uav for spec in specs], state, driven),
    )
    for i, spec in enumerate(specs):
        planned: list[Fault | NavigationFault] = [*spec.faults, *spec.navigation_faults]
        for fault in sorted(planned, key=lambda fault: fault.time):
            inject(fleet, i, fault, -math.inf)
    return fleet
