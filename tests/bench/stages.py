"""What each stage of a tick costs: a swarm's vehicles and autopilots in one process and one thread, over real sockets.

The very functions of the processes are called in their order; between them compiled code reads the clock. What a flight
costs beyond their sum is Python between ticks, the mesh, and waking processes up.
"""

from __future__ import annotations

from contextlib import ExitStack, closing
from typing import Any

import numba
import numpy as np

from ftcc.airside.compiled_stages import flight_of as autopilot_flight
from ftcc.airside.group import build_group as build_autopilots
from ftcc.airside.process import columns as signal_columns
from ftcc.groundside.scenario.mission import Mission
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, SIMULATOR, Endpoint
from ftcc.link.ports import reserve
from ftcc.link.recording import LINK_COLUMNS, new_rows
from ftcc.link.system_calls import monotonic
from ftcc.link.wire import connect
from ftcc.sim.group import build_group as build_vehicles
from ftcc.sim.plants import cycle_of
from ftcc.sim.plants import flight_of as vehicle_flight
from ftcc.sim.process import columns as truth_columns

__all__ = ["LAW", "STAGES", "stage_times"]

STAGES = (
    "vehicle: receive and read commands",
    "vehicle: bring into force",
    "vehicle: sense",
    "vehicle: write and send state",
    "vehicle: record",
    "vehicle: fly on",
    "autopilot: receive and read states",
    "autopilot: sense",
    "autopilot: hear",
    "autopilot: refer",
    "autopilot: control",
    "autopilot: write and send command",
    "autopilot: publish to neighbours in the process",
    "autopilot: record",
)
LAW = ("autopilot: hear", "autopilot: refer", "autopilot: control")
"""One control period of a law."""


def _flyer(mission: Mission) -> Any:
    """A compiled function that flies some ticks and adds the time of each stage to its last argument."""
    vehicle, pilot = vehicle_flight(mission.plant), autopilot_flight(mission.scheme.name)
    force, send_state, record, fly_on, listen = (
        vehicle.bring_into_force, vehicle.transmit, vehicle.record, vehicle.fly_on, vehicle.listen,
    )  # fmt: skip
    measure = cycle_of(mission.plant).sense
    hear_states, sense, hear, refer, control, actuate, publish, report = (
        pilot.listen, pilot.sense, pilot.hear, pilot.refer, pilot.control, pilot.actuate, pilot.publish, pilot.record,
    )  # fmt: skip

    @numba.njit
    def fly(vehicles, pilots, timing, first, last, room, spent):
        every = range(vehicles.alive.shape[0])
        for tick in range(first, last):
            now_us = tick * timing.period_us
            vehicles.tick[0] = tick
            vehicles.rows.filled[:] = 0
            pilots.rows.filled[:] = 0
            pilots.link_rows.filled[:] = 0
            clock = monotonic(room)
            for stage in range(14):
                if stage == 0 and tick > 0:
                    listen(vehicles, timing, now_us - timing.period_us)
                if stage == 6:
                    hear_states(pilots, timing)
                for i in every:
                    if stage == 1:
                        force(vehicles, timing, i)
                    elif stage == 2:
                        state, controls = vehicles.states[i], vehicles.controls[i]
                        true, measured = vehicles.true[i], vehicles.measured
                        measure(vehicles.fleet, i, tick, now_us, timing.seed, true, measured, state, controls)
                    elif stage == 3:
                        send_state(vehicles, timing, i)
                    elif stage == 4:
                        record(vehicles, timing, i)
                    elif stage == 5:
                        fly_on(vehicles, timing, i)
                    elif stage == 7:
                        pilots.active[i] = 1
                        sense(pilots, i, now_us)
                    elif stage == 8:
                        hear(pilots, timing, i, now_us)
                    elif stage == 9:
                        refer(pilots, timing, i, now_us)
                    elif stage == 10:
                        control(pilots, timing, i, now_us)
                    elif stage == 11:
                        actuate(pilots, i, now_us)
                    elif stage == 12 and now_us % timing.exchange_us == 0:
                        publish(pilots, timing, i, now_us)
                    elif stage == 13:
                        report(pilots, timing, i, now_us)
                now = monotonic(room)
                spent[stage] += now - clock
                clock = now

    return fly


def _connected(mission: Mission, stack: ExitStack) -> tuple[list[Endpoint], list[Endpoint]]:
    """Both ends of every pair."""
    ports = reserve([spec.uav for spec in mission.vehicles])
    stack.callback(ports.release)
    ends: tuple[list[Endpoint], list[Endpoint]] = ([], [])
    for spec in mission.vehicles:
        own = ports.of(spec.uav)
        ends[0].append(Endpoint(spec.uav, SIMULATOR, own.vehicle, (LOOPBACK, own.autopilot)))
        ends[1].append(Endpoint(spec.uav, AUTOPILOT, own.autopilot, (LOOPBACK, own.vehicle)))
    for end in (*ends[0], *ends[1]):
        stack.enter_context(closing(end))
    return ends


def stage_times(mission: Mission, ticks: int = 2000, warm_up: int = 100) -> dict[str, float]:
    """Mean time of each stage per UAV and tick, us; the mission must fly ``warm_up`` + ``ticks`` at least."""
    k = len(mission.vehicles)
    vehicles = build_vehicles(
        mission.vehicles, new_rows(k, len(truth_columns(mission.plant, bool(mission.vehicles[0].obstacles)))), ticks
    )
    pilots = build_autopilots(
        mission.autopilots,
        mission.timing,
        new_rows(k, len(signal_columns(mission.scheme.name))),
        new_rows(k, len(LINK_COLUMNS)),
    )
    fly, room = _flyer(mission), np.zeros(2, np.int64)
    with ExitStack() as stack:
        ends = _connected(mission, stack)
        connect(vehicles.wire, ends[0], -1)
        connect(pilots.wire, ends[1], -1)
        fly(vehicles, pilots, mission.timing, 0, warm_up, room, np.zeros(len(STAGES)))
        spent = np.zeros(len(STAGES))
        fly(vehicles, pilots, mission.timing, warm_up, warm_up + ticks, room, spent)
    if not (vehicles.alive.all() and (pilots.done == warm_up + ticks - 1).all()):
        raise RuntimeError(f"{mission.name}: not every UAV flew to the end of the measurement")
    return {name: 1e6 * seconds / (ticks * k) for name, seconds in zip(STAGES, spent.tolist(), strict=True)}
