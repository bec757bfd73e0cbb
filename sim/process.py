"""The vehicle process: flies one or several vehicles and speaks MAVLink with their autopilots.

At tick k a vehicle latches the command that answers state k-1, sends state k with the command in force, and flies on to
k+1. In real time it paces itself on the wall clock and holds the last command where a new one is late; in lockstep it
waits for it.
"""

from __future__ import annotations

import collections
import functools
import time
from collections.abc import Sequence
from types import ModuleType

import numpy as np

from ftcc.link.actuators import decode_command, in_slots, unit_of
from ftcc.link.attitude_target import TARGET, decode_target, path_of
from ftcc.link.failures import Failure, failure_answer, read_failure
from ftcc.link.gate import Ended, Gate, Lost, Ready, Said
from ftcc.link.happenings import drained
from ftcc.link.mavlink import (
    LOOPBACK,
    SIMULATOR,
    Endpoint,
    dialect,
    ending_message,
    ends,
    float_array,
    read_attitude,
    read_command,
    read_target,
    state_messages,
)
from ftcc.link.process import RESEND, Setting, Stall, Telemetry, Waiter
from ftcc.link.recording import Column, PartWriter
from ftcc.sim.failures import faults_of, inject
from ftcc.sim.obstacles import clearance, entered_text
from ftcc.sim.plant import DIVERGED, LOST, TRUTH, UNITS, Fleet, X, Z, latch
from ftcc.sim.plants import conditions_of, cycle_of, find
from ftcc.sim.spec import VehicleSpec, build

__all__ = ["Vehicles", "columns", "load_compiled", "run", "truth_array"]


_PATHS = 16
"""States whose path a vehicle remembers, for commands that come late."""

_CLEARANCE = Column("clearance", "m", "height above the obstacle below, or above z = 0 where there is none")


def columns(plant: str, obstacles: bool = False) -> tuple[Column, ...]:
    """Columns of a vehicle's part of the recording; clearance where there are obstacles."""
    actuators = in_slots(find(plant).ACTUATORS)
    return (
        Column("t", "s", "simulated time"),
        Column("uav", "-", "id"),
        *(Column(name, UNITS[name], "altitude, up" if name == "z" else "") for name in TRUTH),
        *(Column(f"{name}_command", unit_of(name), "command in force") for name in actuators),
        *(Column(name, unit_of(name), "what acts on the airframe") for name in actuators),
        *(Column(name, unit, "true value") for name, unit in conditions_of(plant)),
        *([_CLEARANCE] if obstacles else []),
    )


def truth_array(plant: str) -> tuple[str, ...]:
    """Contents of the DEBUG_FLOAT_ARRAY "truth" that a vehicle sends to the station, and to nobody else."""
    actuators = in_slots(find(plant).ACTUATORS)
    return (
        *TRUTH,
        *(f"{name}_command" for name in actuators),
        *actuators,
        *(name for name, _ in conditions_of(plant)),
        "late",
    )


def run(specs: Sequence[VehicleSpec], setting: Setting, gate: Gate) -> None:
    """Fly the vehicles of this process from the launcher's go to its release."""
    vehicles = Vehicles(specs, setting, gate)
    try:
        gate.tell(Ready())
        gate.wait_until_go()
        vehicles.fly()
    finally:
        vehicles.close()


def load_compiled(fleet: Fleet, cycle: ModuleType) -> None:
    """Load, or compile, the functions of a tick, those of ``cycle_of`` the plant among them, before the flight."""
    k = len(fleet.uav)
    nobody, true, seen = np.zeros(k, np.int64), np.zeros((k, len(TRUTH))), np.zeros(len(TRUTH))
    cycle.report_state(fleet, nobody, 0, 0, 0, true, seen, np.zeros((k, 13)), np.zeros((k, 4)))
    cycle.fly_period(fleet, nobody, 0, 1, 1, nobody)
    decode_command(np.zeros(4), fleet.travel[0], np.zeros(4))
    waiting = fleet.waiting[0]
    latch(fleet, 0, fleet.command[0].copy())
    fleet.waiting[0] = waiting
    V, gamma, chi = path_of(1.0, 0.0, 0.0)
    decode_target(np.zeros(len(TARGET)), V, gamma, chi, fleet.travel[0], fleet.code[0], np.zeros(4))
    cycle.conditions(fleet, 0, 0.0, np.zeros(8 + fleet.disturbed.shape[1]))
    clearance(fleet.zones, 0.0, 0.0)


class Vehicles:
    """The vehicles of a process."""

    def __init__(self, specs: Sequence[VehicleSpec], setting: Setting, gate: Gate) -> None:
        self.specs = specs
        self.setting = setting
        self.timing = setting.timing
        self.gate = gate
        self.fleet = build(specs)
        self.cycle = cycle_of(specs[0].plant)
        k = len(specs)
        self.alive = np.ones(k, np.int64)
        self.true = np.zeros((k, len(TRUTH)))
        self.seen = np.zeros(len(TRUTH))
        self.messages = np.zeros((k, 13))
        self.controls = np.zeros((k, 4))
        self.why = np.zeros(k, np.int64)
        self.answered = np.full(k, -1, np.int64)
        self.received = np.zeros((k, 4))
        self.latched = np.zeros(4)
        self.attitude = np.zeros(len(TARGET))
        self.paths: list[collections.deque[tuple[int, tuple[float, float, float]]]] = [
            collections.deque(maxlen=_PATHS) for _ in specs
        ]
        """Stamp (us) and path of the last states sent."""
        self.targets = np.zeros((k, 7))
        self.late = np.zeros(k, np.int64)
        self.conditions = np.zeros(len(conditions_of(specs[0].plant)))
        self.tick = 0
        ports = [setting.ports[spec.uav] for spec in specs]
        self.pilots = [
            Endpoint(spec.uav, SIMULATOR, port.vehicle, (LOOPBACK, port.autopilot))
            for spec, port in zip(specs, ports, strict=True)
        ]
        self.station = [
            Endpoint(setting.system(spec.uav), SIMULATOR, port.truth, (LOOPBACK, setting.station))
            for spec, port in zip(specs, ports, strict=True)
        ]
        parts = setting.folder / "parts"
        self.parts = [PartWriter(parts / f"{s.uav}-vehicle.arrows", columns(s.plant, bool(s.obstacles))) for s in specs]
        self.telemetry = Telemetry(self.timing)
        self.stall = Stall()
        self.waiter = Waiter()
        self.waiter.add(gate, gate.read)
        self.patience = Waiter()
        """Waits for the launcher alone."""
        self.patience.add(gate, gate.read)
        for i, pilot in enumerate(self.pilots):
            self.waiter.add(pilot, functools.partial(self.listen, i))
        load_compiled(self.fleet, self.cycle)

    def fly(self) -> None:
        """All ticks, or until everything is lost or the launcher stops the flight."""
        for tick in range(self.timing.ticks + 1):
            self.tick = tick
            if not self.wait() or not self.alive.any():
                break
            self.latch()
            self.send_state()
            self.record()
            self.advance()
            self.report()
        else:
            # A state that got lost must still be sent again until it is answered.
            self.tick = self.timing.ticks + 1
            if self.setting.lockstep:
                self.wait()
        for part in self.parts:
            part.close()
        self.gate.tell(Ended(self.tick, int(self.late.sum()), self.tick * len(self.specs)))
        self.gate.wait_until_released(60.0)

    @property
    def now_us(self) -> int:
        """Simulated time of the present tick."""
        return self.tick * self.timing.period_us

    def wait(self) -> bool:
        """Wait until the present tick may begin; False if the flight is to end."""
        self.stall.progress()
        sent = time.monotonic()
        while True:
            if self.gate.stopping:
                return False
            if not self.gate.open(self.tick):
                self.gate.hold(self.tick)
                self.stall.progress()
                self.waiter.wait(1.0)
            elif not self.setting.lockstep:
                rest = self.gate.due(self.tick, self.timing.period) - time.monotonic()
                if rest <= 0.0:
                    # What has come meanwhile is read now: a wake-up costs more than the reading.
                    self.waiter.wait(0.0)
                    return True
                self.patience.wait(rest)
            else:
                missing = self.missing()
                if not missing:
                    return True
                if not self.waiter.wait(RESEND) or time.monotonic() - sent > RESEND:
                    sent = time.monotonic()
                    for i in missing:
                        self.pilots[i].send_again()
                if self.stall.long:
                    names = ", ".join(str(self.specs[i].uav) for i in missing)
                    self.gate.tell(Said("warning", f"vehicles wait for commands of UAV {names} at tick {self.tick}"))

    def missing(self) -> list[int]:
        """Who has not answered the last state."""
        if self.tick == 0:
            return []
        wanted = self.now_us - self.timing.period_us
        return [i for i in range(len(self.specs)) if self.alive[i] and self.answered[i] < wanted]

    def listen(self, i: int) -> None:
        """Take in what the autopilot of vehicle ``i`` sent; the newest command counts."""
        pilot = self.pilots[i]
        messages = pilot.receive(self.setting.datagrams)
        for n, message in enumerate(messages):
            if ends(message):
                self.lose(i, DIVERGED, self.now_us - self.timing.period_us)
                continue
            failure, at_us = read_failure(messages[n : n + 2])
            if failure is not None:
                self.fail(i, failure, at_us)
                continue
            if self.specs[i].kind == "reference_point":
                stamp = read_target(message, self.targets[i])
            elif self.specs[i].attitude_code.loading > 0.0:
                stamp = read_attitude(message, self.attitude)
                if stamp >= 0 and not self.understand(i, stamp):
                    continue
            else:
                stamp = read_command(message, self.received[i])
            if not self.alive[i]:
                pilot.send_again()
            elif stamp >= 0:
                self.answered[i] = max(self.answered[i], stamp)

    def fail(self, i: int, failure: Failure, at_us: int) -> None:
        """Arm a failure, at a simulated time or (0) at once, and answer the autopilot."""
        at_us = at_us or self.now_us
        faults = faults_of(self.fleet, i, failure, at_us / 1e6)
        if not faults:
            result = dialect.MAV_RESULT_UNSUPPORTED
        elif at_us < self.now_us or not self.alive[i]:
            result = dialect.MAV_RESULT_DENIED
        elif all(inject(self.fleet, i, fault, self.now_us / 1e6) for fault in faults):
            result = dialect.MAV_RESULT_ACCEPTED
        else:
            result = dialect.MAV_RESULT_TEMPORARILY_REJECTED
        self.pilots[i].send_aside(failure_answer(self.specs[i].uav, result, at_us))

    def understand(self, i: int, stamp_us: int) -> bool:
        """Read vehicle ``i``'s attitude target by the path of the state that it answers; False if that is forgotten."""
        for stamp, (V, gamma, chi) in self.paths[i]:
            if stamp == stamp_us:
                travel, code = self.fleet.travel[i], self.fleet.code[i]
                decode_target(self.attitude, V, gamma, chi, travel, code, self.received[i])
                return True
        return False

    def latch(self) -> None:
        """Bring the newest commands into force; one that does not answer the last state is late."""
        if self.tick == 0:
            return
        for i, spec in enumerate(self.specs):
            if self.alive[i]:
                self.late[i] += int(not self.answers_last(i))
                if self.answered[i] < 0:
                    continue
                if spec.kind == "reference_point":
                    self.fleet.target[i] = self.targets[i]
                else:
                    if spec.attitude_code.loading > 0.0:
                        self.latched[:] = self.received[i]
                    else:
                        decode_command(self.received[i], self.fleet.travel[i], self.latched)
                    latch(self.fleet, i, self.latched)

    def answers_last(self, i: int) -> bool:
        """Whether the command in force of vehicle ``i`` answers its last state."""
        return self.tick > 0 and self.answered[i] == self.now_us - self.timing.period_us

    def send_state(self) -> None:
        """Measure and tell the autopilots."""
        self.cycle.report_state(
            self.fleet,
            self.alive,
            self.tick,
            self.now_us,
            self.timing.seed,
            self.true,
            self.seen,
            self.messages,
            self.controls,
        )
        for i, pilot in enumerate(self.pilots):
            if self.alive[i]:
                known = self.answers_last(i) and self.specs[i].delay == 0
                told = None if known else self.controls[i]
                if self.specs[i].attitude_code.loading > 0.0:
                    vx, vy, vz = self.messages[i, 10:].tolist()
                    self.paths[i].append((self.now_us, path_of(vx, vy, vz)))
                pilot.send(*state_messages(self.now_us, self.messages[i], told))

    def record(self) -> None:
        """Append a row of truth to each part; tell what happened."""
        if self.tick % self.timing.record_every == 0:
            for i, spec in enumerate(self.specs):
                if self.alive[i]:
                    true = self.true[i]
                    over = (clearance(self.fleet.zones, true[X], true[Z]),) if spec.obstacles else ()
                    self.parts[i].row((self.now_us / 1e6, spec.uav, *self.known(i), *over))
        if self.fleet.happenings.used[0]:
            for at_us, i, _, number in drained(self.fleet.happenings):
                uav = self.specs[i].uav
                self.gate.tell(Said("warning", entered_text(uav, number), uav, at_us))

    def known(self, i: int) -> list[float]:
        """What only the simulator knows of vehicle ``i`` now, in the order of the `truth_array`."""
        self.cycle.conditions(self.fleet, i, self.now_us / 1e6, self.conditions)
        return [*self.true[i], *self.fleet.command[i], *self.fleet.acting[i], *self.conditions]

    def advance(self) -> None:
        """Fly one period; a vehicle that leaves its model is lost."""
        self.cycle.fly_period(self.fleet, self.alive, self.now_us, self.timing.period_us, self.timing.step_us, self.why)
        for i in range(len(self.specs)):
            if self.alive[i] and self.why[i]:
                self.lose(i, int(self.why[i]), self.now_us + self.timing.period_us)

    def lose(self, i: int, why: int, at_us: int) -> None:
        """Declare a vehicle lost, to its autopilot and to the launcher."""
        if not self.alive[i]:
            return
        self.alive[i] = 0
        self.parts[i].flush()
        self.pilots[i].send(ending_message())
        self.gate.tell(Lost(self.specs[i].uav, at_us, LOST[why]))

    def report(self) -> None:
        """Truth to the station."""
        if not self.telemetry.due(self.tick):
            return
        for i in range(len(self.specs)):
            if self.alive[i]:
                truth = [*self.known(i), float(self.late[i])]
                self.station[i].send(float_array(self.now_us, "truth", truth))
        for part in self.parts:
            part.flush_if_due()

    def close(self) -> None:
        """Free the ports."""
        for endpoint in (*self.pilots, *self.station):
            endpoint.close()
        self.waiter.close()
        self.patience.close()
