"""The vehicle process: flies one or several vehicles and speaks MAVLink with their autopilots.

At tick k a vehicle latches the command that answers state k-1, sends state k, and flies on to k+1: in compiled code,
see `flight`. This file does the work beside the ticks: failures that are injected, the recording, the station, the
launcher. In lockstep a vehicle waits for the command; on the wall clock it holds the last one where a new one is late.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import ModuleType

import numpy as np

from ftcc.link.actuators import ACTUATORS, SLOT, by_slot, in_slots, unit_of
from ftcc.link.compiled import entry_of
from ftcc.link.events import drain_events
from ftcc.link.failures import Failure, failure_answer, read_failure
from ftcc.link.gate import Ended, EventReport, Gate, Lost, Ready
from ftcc.link.mavlink import LOOPBACK, SIMULATOR, Endpoint, dialect, ending_message, ends, float_array
from ftcc.link.process import Setting, Stall, Telemetry, Waiter
from ftcc.link.recording import Column, Recorder, is_full, part_path
from ftcc.link.timing import Timing
from ftcc.link.waiting import ATTEND, DATAGRAM, FLOWN, HELD, WORK
from ftcc.link.wire import connect, keep_sent, send_again, split
from ftcc.sim.group import VehicleGroup, build_group
from ftcc.sim.injection import faults_of, inject
from ftcc.sim.jsbsim.flight import lost_text
from ftcc.sim.obstacles import entered_text
from ftcc.sim.plant import DIVERGED, TRUTH, UNITS
from ftcc.sim.plants import conditions_of, find, flight_of
from ftcc.sim.spec import VehicleSpec

__all__ = ["Vehicles", "columns", "load_compiled", "main", "places", "truth_array"]

_ATTENTION = 0.05
"""Wall time between two looks at the launcher and the clock, s."""
_NO_LIMIT = np.iinfo(np.int64).max

_CLEARANCE = Column("clearance", "m", "height above the obstacle below, or above z = 0 where there is none")


def columns(plant: str, obstacles: bool = False) -> tuple[Column, ...]:
    """Columns of a vehicle's part of the recording; clearance where there are obstacles."""
    actuators = by_slot(find(plant).ACTUATORS)
    return (
        Column("t", "s", "simulated time"),
        Column("uav", "-", "id"),
        *(Column(name, UNITS[name], "altitude, up" if name == "z" else "") for name in TRUTH),
        *(Column(f"{name}_command", unit_of(name), "command in force") for name in actuators),
        *(Column(name, unit_of(name), "what acts on the airframe") for name in actuators),
        *(Column(name, unit, "true value") for name, unit in conditions_of(plant)),
        *([_CLEARANCE] if obstacles else []),
    )


def places(plant: str, obstacles: bool = False) -> tuple[int, ...]:
    """Where the numbers of `columns` stand in a row as it is filled: such a row has all slots of the actuators."""
    slots = [SLOT[name] for name in by_slot(find(plant).ACTUATORS)]
    commands = 2 + len(TRUTH)
    acting, conditions = commands + len(ACTUATORS), commands + 2 * len(ACTUATORS)
    rest = range(conditions, conditions + len(conditions_of(plant)) + obstacles)
    return (*range(commands), *(commands + slot for slot in slots), *(acting + slot for slot in slots), *rest)


def truth_array(plant: str) -> tuple[str, ...]:
    """Contents of the DEBUG_FLOAT_ARRAY "truth", which a vehicle sends to our ground station alone."""
    actuators = in_slots(find(plant).ACTUATORS)
    return (
        *TRUTH,
        *(f"{name}_command" for name in actuators),
        *actuators,
        *(name for name, _ in conditions_of(plant)),
        "late",
    )


def main(specs: Sequence[VehicleSpec], setting: Setting, gate: Gate) -> None:
    """Fly the vehicles of this process from the launcher's go to its release."""
    vehicles = Vehicles(specs, setting, gate)
    try:
        gate.report(Ready())
        gate.wait_until_go()
        vehicles.fly()
    finally:
        vehicles.close()


class Vehicles:
    """The vehicles of a process."""

    def __init__(self, specs: Sequence[VehicleSpec], setting: Setting, gate: Gate) -> None:
        self.specs = specs
        self.setting = setting
        self.timing = setting.timing
        self.gate = gate
        self.flight = flight_of(specs[0].plant)
        ports = [setting.ports[spec.uav] for spec in specs]
        self.pilots = [
            Endpoint(spec.uav, SIMULATOR, port.vehicle, (LOOPBACK, port.autopilot))
            for spec, port in zip(specs, ports, strict=True)
        ]
        self.station = [
            Endpoint(setting.system(spec.uav), SIMULATOR, port.truth, (LOOPBACK, setting.station))
            for spec, port in zip(specs, ports, strict=True)
        ]
        plant, obstacles = specs[0].plant, bool(specs[0].obstacles)
        self.recorder = Recorder(
            [part_path(setting.folder, spec.uav, "vehicle") for spec in specs],
            columns(plant, obstacles),
            places(plant, obstacles),
            on_trouble=lambda text: gate.report(EventReport("error", text)),
        )
        self.waiter = Waiter()
        self.waiter.add(gate, gate.read)
        self.telemetry = Telemetry(self.timing)
        self.group = build_group(specs, self.recorder.rows, self.telemetry.every)
        connect(self.group.wire, self.pilots, self.waiter.fileno())
        self.stall = Stall()
        load_compiled(self.group, self.timing, self.flight)
        self._fly = entry_of(self.flight.fly, self.group, self.timing, setting.lockstep)

    @property
    def tick(self) -> int:
        """The next tick."""
        return int(self.group.tick[0])

    @property
    def now_us(self) -> int:
        """Simulated time of the next tick."""
        return self.tick * self.timing.period_us

    def fly(self) -> None:
        """Fly all ticks, or until all vehicles are lost or the launcher stops the flight."""
        cause = ATTEND
        flown = -1
        while cause != FLOWN:
            if cause == DATAGRAM:
                self.take_datagram()
            elif cause == WORK:
                self.work(self.tick - 1)
            elif cause == HELD:
                self.hold()
            else:
                self.waiter.wait(0.0)
            if self.gate.stopping:
                break
            if self.tick != flown:
                flown = self.tick
                self.stall.progress()
            self.report_stall()
            self.apply_gate()
            cause = self._fly(self.group, self.timing, self.setting.lockstep)
        self.recorder.close()
        late = int(self.group.late.sum())
        self.gate.report(Ended(self.tick, late, self.tick * len(self.specs)))
        self.gate.wait_until_released(60.0)

    def apply_gate(self) -> None:
        """Give the compiled flight the limit and the pace."""
        limit = self.gate.limit
        self.group.limit[0] = _NO_LIMIT if limit is None else limit
        pace = self.gate.take_pace()
        if pace is not None:
            tick = self.tick if pace.tick is None else pace.tick
            self.group.pace[:] = pace.wall, tick, pace.speed
        self.group.attention[0] = time.monotonic() + _ATTENTION

    def hold(self) -> None:
        """Report to the launcher, once, that this process is held; write what it has recorded, for who looks now."""
        if not self.gate.is_held(self.tick):
            self.recorder.write()
        self.gate.hold(self.tick)
        self.stall.progress()

    def report_stall(self) -> None:
        """Report for which UAVs this process waits, where it has waited for long."""
        if self.setting.lockstep and self.stall.long:
            wanted = self.now_us - self.timing.period_us
            missing = [i for i in range(len(self.specs)) if self.group.alive[i] and self.group.answered[i] < wanted]
            names = ", ".join(str(self.specs[i].uav) for i in missing)
            self.gate.report(EventReport("warning", f"vehicles wait for commands of UAV {names} at tick {self.tick}"))

    # Beside the ticks.

    def take_datagram(self) -> None:
        """Take in the datagram at hand, which compiled code cannot read."""
        wire = self.group.wire
        i = int(wire.whose[0])
        before = None
        """The message before this one: it may hold the sizes of a failure."""
        for message in split(wire, self.pilots[i].codec):
            if message is None:
                self.flight.take(self.group, self.timing, i)
            elif ends(message):
                self.lose(i, DIVERGED, self.now_us - self.timing.period_us)
            else:
                failure, at_us = read_failure([before, message]) if before is not None else (None, 0)
                if failure is not None:
                    self.inject(i, failure, at_us)
            before = message

    def inject(self, i: int, failure: Failure, at_us: int) -> None:
        """Make faults of a failure, which begin at a simulated time (us) or, for 0, at once; answer the autopilot."""
        fleet = self.group.fleet
        at_us = at_us or self.now_us
        faults = faults_of(fleet, i, failure, at_us / 1e6)
        if not faults:
            result = dialect.MAV_RESULT_UNSUPPORTED
        elif at_us < self.now_us or not self.group.alive[i]:
            result = dialect.MAV_RESULT_DENIED
        elif all(inject(fleet, i, fault, self.now_us / 1e6) for fault in faults):
            result = dialect.MAV_RESULT_ACCEPTED
        else:
            result = dialect.MAV_RESULT_TEMPORARILY_REJECTED
        self.pilots[i].send(failure_answer(self.specs[i].uav, result, at_us))

    # After a tick.

    def work(self, tick: int) -> None:
        """Write rows, report events and losses, send the truth to the station."""
        now_us = tick * self.timing.period_us
        if is_full(self.recorder.rows):
            self.recorder.write()
        if tick % self.timing.report_every == 0:
            self.recorder.write_if_due()
        if self.group.fleet.events.used[0]:
            for at_us, i, _, number in drain_events(self.group.fleet.events):
                uav = self.specs[i].uav
                self.gate.report(EventReport("warning", entered_text(uav, number), uav, at_us))
        if self.group.lost[0]:
            for i in range(len(self.specs)):
                if self.group.why[i] and not self.group.alive[i]:
                    self.report_lost(i, int(self.group.why[i]), now_us + self.timing.period_us)
            self.group.lost[0] = 0
        if self.telemetry.due(tick):
            self.report_truth(now_us)

    def report_truth(self, now_us: int) -> None:
        """Send the truth of all living vehicles to the station."""
        for i in range(len(self.specs)):
            if self.group.alive[i]:
                truth = [*self.group.truth_reports[i].tolist(), float(self.group.late[i])]
                self.station[i].send(float_array(now_us, "truth", truth))

    def lose(self, i: int, why: int, at_us: int) -> None:
        """Vehicle ``i`` is lost: stop flying it, and report why, a key of ``plant.LOST``."""
        if self.group.alive[i]:
            self.group.alive[i] = 0
            self.report_lost(i, why, at_us)

    def report_lost(self, i: int, why: int, at_us: int) -> None:
        """Report a loss to the autopilot, again whenever it asks, and to the launcher."""
        self.group.why[i] = 0
        self.recorder.write()
        datagram = self.pilots[i].pack(ending_message())
        keep_sent(self.group.wire, i, datagram)
        send_again(self.group.wire, i)
        self.gate.report(Lost(self.specs[i].uav, at_us, lost_text(self.group.fleet.model, i, why)))

    def close(self) -> None:
        """Free the ports."""
        for endpoint in (*self.pilots, *self.station):
            endpoint.close()
        self.waiter.close()


def load_compiled(group: VehicleGroup, timing: Timing, flight: ModuleType) -> None:
    """Load, or compile, the flight of a group before it begins."""
    limit = int(group.limit[0])
    group.limit[0] = -1
    flight.fly(group, timing, True)
    group.limit[0] = limit
    flight.take(group, timing, 0)
