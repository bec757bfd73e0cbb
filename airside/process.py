"""The autopilot process: one or several autopilots of a swarm, each a tick per state that its vehicle sends.

The tick is ``sense -> hear -> refer -> control -> actuate -> tell -> report``. In real time an autopilot works on every
state that arrives and on the newest records it has. In lockstep it waits for every record that could be usable at its
tick and never runs ahead of those who hear it.
"""

from __future__ import annotations

import collections
import functools
import time
from collections.abc import Sequence
from types import ModuleType

import numpy as np

from ftcc.airside.autopilots import Autopilots, aim, build, sense_all, tick_of, told
from ftcc.airside.ground import GroundLink, Seat
from ftcc.airside.link_events import LinkEvents, link_events, set_links
from ftcc.airside.neighbourhood import Neighbourhood
from ftcc.airside.schemes import find
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.attitude_target import TARGET
from ftcc.link.channel import LINK_REPORT, Inbox, admit, report_link
from ftcc.link.gate import Ended, Gate, Ready, Said
from ftcc.link.mavlink import (
    AUTOPILOT,
    LOOPBACK,
    Endpoint,
    attitude_message,
    command_message,
    ending_message,
    ends,
    read_state,
    target_message,
)
from ftcc.link.process import RESEND, Setting, Stall, Telemetry, Waiter
from ftcc.link.record import Record
from ftcc.link.recording import LINK_COLUMNS, Column, PartWriter, part_path

__all__ = ["Crew", "columns", "load_compiled", "run"]

_POLL = 0.001
"""Wall time between two looks at the mesh while a record or a greeting is awaited, s."""
_ATTENTION = 0.02
"""Least wall time between two looks at what the ground waits for, s."""
_LOOK = 0.1
"""Longest, s."""


def columns(scheme: str) -> tuple[Column, ...]:
    """Columns of an autopilot's part of the recording."""
    signals = (Column(s.name, s.unit, s.meaning) for s in find(scheme).signals)
    return (Column("t", "s", "simulated time"), Column("uav", "-", "id"), *signals)


def run(specs: Sequence[AutopilotSpec], setting: Setting, gate: Gate) -> None:
    """Fly the autopilots of this process from the launcher's go to its release."""
    crew = Crew(specs, setting, gate)
    try:
        if crew.law.REFUSAL and specs[0].uav == min(setting.ports):
            # One process speaks for all.
            gate.tell(Said("warning", crew.law.REFUSAL))
        crew.meet()
        gate.tell(Ready())
        gate.wait_until_go()
        crew.fly()
    finally:
        crew.close()


def load_compiled(autopilots: Autopilots, inbox: Inbox, events: LinkEvents, law: ModuleType) -> None:
    """Load, or compile, the functions of a tick before the flight."""
    k = len(autopilots.own)
    nobody, state, controls = np.zeros(k, np.int64), np.zeros((k, 13)), np.zeros((k, 4))
    sense_all(autopilots, nobody, state, controls, 0)
    law.hear_and_control(autopilots, inbox, nobody, controls, nobody, 0, 1)
    set_links(events, inbox, -1)
    aim(autopilots, 0, np.zeros(len(TARGET)), np.zeros(4))
    admit(inbox, 0, 0, -1, 0, True, autopilots.shared[0], 0, 0, 0)
    report_link(inbox, 0, 0, np.zeros(len(LINK_REPORT)))


def _those(mask: np.ndarray) -> list[int]:
    """Indices where ``mask`` is set."""
    return np.flatnonzero(mask).tolist()  # type: ignore[no-any-return]


class Crew:
    """The autopilots of a process."""

    def __init__(self, specs: Sequence[AutopilotSpec], setting: Setting, gate: Gate) -> None:
        self.specs = specs
        self.setting = setting
        self.timing = setting.timing
        self.gate = gate
        self.autopilots, self.inbox = build(specs, self.timing)
        self.events = link_events(specs)
        self.law = tick_of(specs[0].scheme)
        k = len(specs)
        self.alive = np.ones(k, np.int64)
        self.messages = np.zeros((k, 13))
        self.reported = np.zeros((k, 4))
        self.controls = np.zeros((k, 4))
        self.target = np.zeros(len(TARGET))
        self.ok = np.ones(k, np.int64)
        self.states: list[collections.deque[tuple[int, np.ndarray, np.ndarray | None]]] = [
            collections.deque() for _ in specs
        ]
        self.done = np.full(k, -1, np.int64)
        """Last tick of each autopilot."""
        self.ending: set[int] = set()
        """Whose aircraft is lost."""
        ports = [setting.ports[spec.uav] for spec in specs]
        self.vehicles = [
            Endpoint(spec.uav, AUTOPILOT, port.autopilot, (LOOPBACK, port.vehicle))
            for spec, port in zip(specs, ports, strict=True)
        ]
        self.parts = {
            i: PartWriter(part_path(setting.folder, spec.uav, "autopilot"), columns(spec.scheme))
            for i, spec in enumerate(specs)
            if spec.role == "follower"
        }
        self.link_parts = {
            i: PartWriter(part_path(setting.folder, spec.uav, "links"), LINK_COLUMNS)
            for i, spec in enumerate(specs)
            if spec.neighbours
        }
        self.link_report = np.zeros(len(LINK_REPORT))
        self.neighbourhood = Neighbourhood(specs, setting, gate)
        self.flushing = Telemetry(self.timing)
        self.stall = Stall()
        self.waiter = Waiter()
        self.waiter.add(gate, gate.read)
        for i, vehicle in enumerate(self.vehicles):
            self.waiter.add(vehicle, functools.partial(self.listen, i))
        self.attended = 0.0
        """When what the ground waits for was looked at (wall s, monotonic)."""
        self.ground = [GroundLink(self.seat(i)) for i in range(k)]
        for link in self.ground:
            for socket in link.sockets:
                self.waiter.add(socket, functools.partial(link.listen, socket))
        load_compiled(self.autopilots, self.inbox, self.events, self.law)

    def seat(self, i: int) -> Seat:
        """What the ground may see and touch of autopilot ``i``."""
        return Seat(
            spec=self.specs[i],
            i=i,
            setting=self.setting,
            scheme=find(self.specs[i].scheme),
            autopilots=self.autopilots,
            inbox=self.inbox,
            events=self.events,
            message=self.messages[i],
            controls=self.controls[i],
            vehicle=self.vehicles[i],
            tell=self.gate.tell,
        )

    def meet(self) -> None:
        """Wait until all who hear this process's UAVs have subscribed."""
        self.stall.progress()
        while not self.neighbourhood.ready:
            if self.gate.stopping:
                return
            self.waiter.wait(_POLL)
            if self.stall.long:
                self.gate.tell(Said("warning", f"mesh: still waiting for {self.neighbourhood.awaited}"))

    def fly(self) -> None:
        """All ticks, or until everybody is lost or the launcher stops the flight."""
        if self.setting.lockstep:
            self.fly_in_lockstep()
        else:
            self.fly_in_real_time()
        for i in range(len(self.specs)):
            self.end(i)
        for part in (*self.parts.values(), *self.link_parts.values()):
            part.close()
        for spec, link in zip(self.specs, self.ground, strict=True):
            dropped = {reason: count for reason, count in link.dropped().items() if count}
            if dropped:
                listed = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in dropped.items())
                self.gate.tell(Said("info", f"dropped what came from the ground: {listed}", spec.uav))
        flown = int(self.done.max()) + 1
        self.gate.tell(Ended(flown, 0, flown * len(self.specs)))
        self.gate.wait_until_released(60.0)

    def fly_in_lockstep(self) -> None:
        """Everybody in this process does tick k before anybody does k+1."""
        for tick in range(self.timing.ticks + 1):
            if not self.wait(tick) or not self.alive.any():
                return
            for i in range(len(self.specs)):
                if self.alive[i]:
                    self.take_state(i)
            self.tick(tick, self.alive)

    def fly_in_real_time(self) -> None:
        """Each autopilot works on the states of its vehicle as they arrive."""
        one = np.zeros_like(self.alive)
        while self.alive.any() and not self.gate.stopping:
            self.waiter.wait(_LOOK)
            self.attend()
            self.neighbourhood.take()
            for i in range(len(self.specs)):
                while self.alive[i] and self.states[i]:
                    tick = self.take_state(i)
                    one[:] = 0
                    one[i] = 1
                    self.tick(tick, one)
            self.end_the_lost()
            if (self.done[self.alive == 1] >= self.timing.ticks).all():
                return

    def take_state(self, i: int) -> int:
        """The next state of vehicle ``i`` becomes the present one; its tick.

        Where the vehicle does not say which command is in force, it is the one that answers its last state.
        """
        tick, self.messages[i], controls = self.states[i].popleft()
        self.reported[i] = self.controls[i] if controls is None else controls
        return tick

    # The tick.

    def tick(self, tick: int, active: np.ndarray) -> None:
        """One tick of the ``active`` autopilots."""
        self.sense(tick, active)
        self.hear(tick, active)
        self.control(tick, active)
        self.actuate(tick, active)
        if tick % self.timing.exchange_every == 0:
            self.tell(tick, active)
        self.report(tick, active)

    def sense(self, tick: int, active: np.ndarray) -> None:
        """Own state from the vehicle's message."""
        sense_all(self.autopilots, active, self.messages, self.reported, self.now_us(tick))

    def hear(self, tick: int, active: np.ndarray) -> None:
        """Link events, then the records that are due, through the channel into the inbox."""
        now = self.now_us(tick)
        events = self.events
        if events.position[0] < len(events.at_us) and events.at_us[events.position[0]] <= now:
            set_links(events, self.inbox, now)
        for i in _those(active):
            for edge, record in self.neighbourhood.due(i, now):
                values = np.zeros(self.inbox.values.shape[2])
                values[: len(record.values)] = record.values
                admit(
                    self.inbox,
                    i,
                    edge,
                    record.sequence,
                    record.stamp_us,
                    record.radio_on and bool(events.radio_on[i]),
                    values,
                    self.timing.latency_us,
                    now,
                    self.timing.seed,
                )

    def control(self, tick: int, active: np.ndarray) -> None:
        """The law."""
        self.law.hear_and_control(
            self.autopilots,
            self.inbox,
            active,
            self.controls,
            self.ok,
            self.now_us(tick),
            self.timing.period_us,
        )
        for i in _those(active):
            self.done[i] = tick
            if not self.ok[i]:
                self.give_up(i)

    def actuate(self, tick: int, active: np.ndarray) -> None:
        """Commands to the vehicles."""
        for i in _those(active):
            if not self.alive[i]:
                continue
            if self.specs[i].role == "leader":
                self.vehicles[i].send(target_message(self.specs[i].uav, self.autopilots.target[i]))
            elif self.specs[i].attitude_code.loading > 0.0:
                aim(self.autopilots, i, self.target, self.controls[i])
                self.vehicles[i].send(attitude_message(self.now_us(tick), self.specs[i].uav, self.target))
            else:
                self.vehicles[i].send(command_message(self.now_us(tick), self.controls[i]))

    def tell(self, tick: int, active: np.ndarray) -> None:
        """A record for the neighbours: here those in this process, by the mesh the others."""
        heard = self.neighbourhood.heard(_those(self.alive))
        for i in _those(active):
            if self.alive[i]:
                record = Record(
                    self.specs[i].uav,
                    tick // self.timing.exchange_every,
                    self.now_us(tick),
                    tuple(self.autopilots.shared[i].tolist()),
                    bool(self.events.radio_on[i]),
                    heard=heard,
                )
                self.neighbourhood.publish(record)

    def report(self, tick: int, active: np.ndarray) -> None:
        """What happened, a row of the recording, and telemetry to the ground."""
        now = self.now_us(tick)
        if self.autopilots.happenings.used[0]:
            for at_us, uav, severity, text in told(self.autopilots, self.specs):
                self.gate.tell(Said(severity, text, uav, at_us))
        for i in _those(active):
            if not self.alive[i]:
                continue
            if i in self.parts and tick % self.timing.record_every == 0:
                self.parts[i].row((now / 1e6, self.specs[i].uav, *self.autopilots.signals[i]))
            if i in self.link_parts and tick % self.timing.report_every == 0:
                self.report_links(i, now / 1e6)
            self.ground[i].report(now)
        if self.flushing.due(tick):
            for part in (*self.parts.values(), *self.link_parts.values()):
                part.flush_if_due()

    def report_links(self, i: int, t: float) -> None:
        """A row on each in-edge of autopilot ``i`` at ``t`` (s)."""
        spec = self.specs[i]
        for edge, neighbour in enumerate(spec.neighbours):
            report_link(self.inbox, i, edge, self.link_report)
            self.link_parts[i].row((t, spec.uav, neighbour.uav, *self.link_report))

    # What surrounds the tick.

    def now_us(self, tick: int) -> int:
        """Simulated time of a tick."""
        return tick * self.timing.period_us

    def listen(self, i: int) -> None:
        """Take in what vehicle ``i`` sent; a state that was answered already is answered once more."""
        messages = self.vehicles[i].receive(self.setting.datagrams)
        while messages:
            if ends(messages[0]):
                self.ending.add(i)
            elif messages[0].get_type() == "COMMAND_ACK":
                self.ground[i].failures.vehicle_answered(messages[0])
            state, controls = np.zeros(13), np.zeros(4)
            stamp, used = read_state(messages, state, controls)
            messages = messages[used:]
            tick = stamp // self.timing.period_us
            newest = self.states[i][-1][0] if self.states[i] else int(self.done[i])
            if tick > newest:
                self.states[i].append((tick, state, controls if used == 3 else None))
            elif tick == self.done[i] >= 0:
                self.vehicles[i].send_again()

    def wait(self, tick: int) -> bool:
        """Lockstep: wait until everything that tick needs is here; False if the flight is to end."""
        self.stall.progress()
        sent = time.monotonic()
        while not self.gate.stopping:
            self.attend()
            missing = self.missing_state() or self.neighbourhood.missing(tick, _those(self.alive))
            if not missing:
                return True
            # States wake this process up; the mesh is polled, and only by who needs a record.
            self.waiter.wait(RESEND if self.missing_state() else _POLL)
            if time.monotonic() - sent > RESEND:
                sent = time.monotonic()
                for i in _those(self.alive):
                    if not self.states[i]:
                        self.vehicles[i].send_again()
                if not self.gate.open(tick):
                    self.stall.progress()
                elif self.stall.long:
                    self.gate.tell(Said("warning", f"autopilots of UAV {self.names} at tick {tick} wait for {missing}"))
        return False

    def attend(self) -> None:
        """What the ground waits for, whether the swarm flies or is held."""
        now = time.monotonic()
        if now - self.attended > _ATTENTION:
            self.attended = now
            for link in self.ground:
                link.attend()

    @property
    def names(self) -> str:
        return ", ".join(str(spec.uav) for spec in self.specs)

    def missing_state(self) -> str:
        """Whose state is still awaited, as text; empty if nobody's."""
        self.end_the_lost()
        for i in _those(self.alive):
            if not self.states[i]:
                return f"the state of UAV {self.specs[i].uav}"
        return ""

    def end_the_lost(self) -> None:
        """UAVs whose aircraft is lost end once the states before that are worked off."""
        for i in list(self.ending):
            if not self.states[i]:
                self.ending.discard(i)
                self.end(i)

    def give_up(self, i: int) -> None:
        """The law's command is not finite: tell the vehicle, and end."""
        self.vehicles[i].send(ending_message())
        self.end(i)

    def end(self, i: int) -> None:
        """UAV ``i`` ends: its neighbours must not wait for it."""
        if self.alive[i]:
            self.alive[i] = 0
            tick = int(self.done[i])
            last = Record(self.specs[i].uav, max(tick, 0), self.now_us(max(tick, 0)), (), last=True)
            self.neighbourhood.publish(last)
            self.ground[i].end()

    def close(self) -> None:
        """Free the ports; leave the mesh."""
        for vehicle in self.vehicles:
            vehicle.close()
        for link in self.ground:
            link.close()
        self.neighbourhood.close()
        self.waiter.close()
