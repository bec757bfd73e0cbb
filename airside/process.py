"""The autopilot process: one or several autopilots of a swarm, each a tick per state that its vehicle sends.

A tick, from the datagram of a state to that of the command that answers it, is compiled: `flight` lists its stages.
This module does what happens beside the ticks: transmissions over the mesh, recording, ground, launcher. In lockstep an
autopilot waits for every record that could be usable at its tick and never runs ahead of its receivers; on the wall
clock it works on every state that arrives and on the newest records it has.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from types import ModuleType

from ftcc.airside.attacks.recording import LieRecorder
from ftcc.airside.autopilots import recorded_signals
from ftcc.airside.compiled_stages import flight_of, stages_of
from ftcc.airside.gcs import AutopilotView, GcsLink
from ftcc.airside.group import EVENTS, LOST, PUBLISH, SECOND, TELEMETRY, WRITE, AutopilotGroup, build_group
from ftcc.airside.law_errors import describe_error, describe_not_finite
from ftcc.airside.leader import drain_leader_events
from ftcc.airside.neighbourhood import Neighbourhood
from ftcc.airside.scheme import Quantity
from ftcc.airside.schemes import find
from ftcc.airside.spec import AutopilotSpec, is_active
from ftcc.link.compiled import entry_of
from ftcc.link.gate import Ended, EventReport, Gate, LawFailed, Ready
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, Endpoint, ending_message, ends
from ftcc.link.process import RESEND, Setting, Stall, Waiter
from ftcc.link.recording import LINK_COLUMNS, Column, Recorder, part_path
from ftcc.link.timing import Timing
from ftcc.link.waiting import ATTEND, DATAGRAM, FLOWN, MAIL, WORK
from ftcc.link.wire import connect, keep_sent, send_again, split

__all__ = ["AutopilotProcess", "columns", "load_compiled", "main"]

_ATTENTION = 0.02
"""Wall time between two looks at what the ground waits for, s."""
_UNTIL_RELEASED = 60.0
"""Longest wait for all others to end, wall s."""
_SUBSCRIPTIONS = 0.02
"""Wall time between two looks whether all neighbours have subscribed, s."""


def columns(signals: Iterable[Quantity]) -> tuple[Column, ...]:
    """Columns of an autopilot's part of the recording, for the signals that it records."""
    recorded = (Column(s.name, s.unit, s.meaning) for s in signals)
    return (Column("t", "s", "simulated time"), Column("uav", "-", "id"), *recorded)


def main(specs: Sequence[AutopilotSpec], setting: Setting, gate: Gate) -> None:
    """Fly the autopilots of this process from the launcher's go to its release."""
    process = AutopilotProcess(specs, setting, gate)
    refusal = stages_of(specs[0].scheme, is_active(specs)).REFUSAL
    try:
        if refusal and specs[0].uav == min(setting.ports):
            # One process reports it for all.
            gate.report(EventReport("warning", refusal))
        process.wait_for_neighbours()
        gate.report(Ready())
        gate.wait_until_go()
        try:
            process.fly()
        except Exception as error:
            process.report_law_error(error)
    finally:
        process.close()


def load_compiled(group: AutopilotGroup, timing: Timing, flight: ModuleType) -> None:
    """Load, or compile, the flight of a group before it begins."""
    alive = group.alive.copy()
    group.alive[:] = 0
    flight.fly(group, timing, True)
    flight.take(group, timing, 0)
    group.alive[:] = alive


class AutopilotProcess:
    """The autopilots of a process."""

    def __init__(self, specs: Sequence[AutopilotSpec], setting: Setting, gate: Gate) -> None:
        # Who has no certificate of a UAV cannot speak in its name.
        specs = [replace(spec, authenticated=spec.authenticated or setting.tls is not None) for spec in specs]
        self.specs = specs
        self.setting = setting
        self.timing = setting.timing
        self.gate = gate
        self.flight = flight_of(specs[0].scheme, is_active(specs))
        self.recorder = Recorder(
            [part_path(setting.folder, s.uav, "autopilot") if s.role == "follower" else None for s in specs],
            columns(recorded_signals(specs[0])),
            on_trouble=self.report_trouble,
        )
        self.link_recorder = Recorder(
            [part_path(setting.folder, s.uav, "links") if s.neighbours else None for s in specs],
            LINK_COLUMNS,
            on_trouble=self.report_trouble,
        )
        self.group = build_group(specs, self.timing, self.recorder.rows, self.link_recorder.rows)
        self.lie_recorder = LieRecorder(
            setting.folder,
            [spec.uav for spec in specs],
            find(specs[0].scheme),
            self.group.attacks,
            self.report_trouble,
        )
        load_compiled(self.group, self.timing, self.flight)
        ports = [setting.ports[spec.uav] for spec in specs]
        self.vehicles = [
            Endpoint(spec.uav, AUTOPILOT, port.autopilot, (LOOPBACK, port.vehicle))
            for spec, port in zip(specs, ports, strict=True)
        ]
        self.neighbourhood = Neighbourhood(specs, setting, gate, self.group)
        self.group = self.group._replace(mail=self.neighbourhood.mail)
        self.waiter = Waiter()
        self.waiter.add(gate, gate.read)
        self.gcs_links = [GcsLink(self.view(i)) for i in range(len(specs))]
        self.link_of = {spec.uav: link for spec, link in zip(specs, self.gcs_links, strict=True)}
        for link in self.gcs_links:
            for socket in link.sockets:
                self.waiter.add(socket, partial(link.listen, socket))
        # In real time nobody waits for records: what has come is taken before the next tick.
        mesh = self.neighbourhood.fileno() if setting.lockstep else -1
        connect(self.group.wire, self.vehicles, self.waiter.fileno(), mesh)
        self.stall = Stall()
        self._fly = entry_of(self.flight.fly, self.group, self.timing, setting.lockstep)

    def report_trouble(self, text: str) -> None:
        """Log that something cannot be recorded."""
        self.gate.report(EventReport("error", text))

    def view(self, i: int) -> AutopilotView:
        """What the side towards the ground sees of autopilot ``i``."""
        return AutopilotView(
            spec=self.specs[i],
            i=i,
            setting=self.setting,
            scheme=find(self.specs[i].scheme),
            autopilots=self.group.autopilots,
            inbox=self.group.inbox,
            link_events=self.group.link_events,
            attacks=self.group.attacks,
            state=self.group.states[i],
            controls=self.group.controls[i],
            vehicle=self.vehicles[i],
            send_to_launcher=self.gate.report,
            done=self.group.done[i : i + 1],
        )

    def wait_for_neighbours(self) -> None:
        """Wait until all receivers of this process's records have subscribed."""
        self.stall.progress()
        while not self.neighbourhood.ready and not self.gate.stopping:
            self.waiter.wait(_SUBSCRIPTIONS)
            self.neighbourhood.report_refusals()
            if self.stall.long:
                self.gate.report(EventReport("warning", f"mesh: still waiting for {self.neighbourhood.awaited}"))

    def fly(self) -> None:
        """All ticks, or until everybody is lost or the launcher stops the flight."""
        cause = ATTEND
        while cause != FLOWN:
            if cause == DATAGRAM:
                self.read_datagram()
            elif cause == MAIL:
                self.neighbourhood.receive()
            elif cause == WORK:
                self.finish_tick()
            else:
                self.attend()
            if self.gate.stopping:
                break
            cause = self._fly(self.group, self.timing, self.setting.lockstep)
        self.end()

    # What is to be done after a tick.

    def finish_tick(self) -> None:
        """Put a transmission on the mesh, write rows, log events, send telemetry: what is due of it."""
        to_do = int(self.group.to_do[0])
        if to_do & PUBLISH:
            self.neighbourhood.publish()
        if to_do & LOST:
            self.end_lost()
        if to_do & WRITE:
            self.recorder.write()
            self.link_recorder.write()
            self.lie_recorder.write_if_due()
        if to_do & SECOND:
            self.recorder.write_if_due()
            self.link_recorder.write_if_due()
            self.lie_recorder.write_if_due()
        if to_do & EVENTS:
            for at_us, uav, severity, text in drain_leader_events(self.group.autopilots, self.specs):
                self.gate.report(EventReport(severity, text, uav, at_us))
                self.link_of[uav].show_event(severity, text)
        if to_do & (TELEMETRY | SECOND):
            # What the log has of each simulated second is sent when this process is awake anyhow.
            self.send_telemetry()

    def send_telemetry(self) -> None:
        """Report to the ground what is due, and find out when something will be due next."""
        group = self.group
        for i, link in enumerate(self.gcs_links):
            if group.active[i]:
                link.report(int(group.done[i]) * self.timing.period_us)
        flying = [link for link in self.gcs_links if link.view.alive]
        group.telemetry_us[0] = min((link.next_us for link in flying), default=0)
        group.telemetry_wall[0] = min((link.next_wall for link in flying), default=0.0)

    def send_telemetry_soon(self) -> None:
        """Look after the next tick what is due."""
        self.group.telemetry_us[0], self.group.telemetry_wall[0] = 0, 0.0

    def report_law_error(self, error: Exception) -> None:
        """Report an error that the law raised, and end; any other error goes on."""
        text = describe_error(error, find(self.specs[0].scheme), self.group.autopilots, self.specs)
        if not text:
            raise error
        i = int(self.group.autopilots.stepping[0])
        self.gate.report(LawFailed(text, int(self.group.done[i]) * self.timing.period_us))
        self.end()

    def end_lost(self) -> None:
        """End the UAVs whose law gave no finite command, and send their vehicles word of it."""
        if self.group.unsendable[0]:
            raise ValueError(f"UAV {self.names}: a value that was to be sent is not finite")
        self.group.lost[0] = 0
        for i, link in enumerate(self.gcs_links):
            if not self.group.alive[i] and link.view.alive:
                text = describe_not_finite(link.view.scheme, self.group.autopilots, i)
                at_us = int(self.group.done[i]) * self.timing.period_us
                self.gate.report(EventReport("warning", text, self.specs[i].uav, at_us))
                keep_sent(self.group.wire, i, self.vehicles[i].pack(ending_message()))
                send_again(self.group.wire, i)
                link.end()

    # What surrounds the ticks.

    def attend(self) -> None:
        """Do what the launcher and the ground ask, whether the swarm flies or is held."""
        if self.waiter.wait(0.0):
            # A request may have changed what is due when; a process that has died is not waited for.
            self.send_telemetry_soon()
            self.neighbourhood.receive()
        now = time.monotonic()
        if now >= self.group.attention[0]:
            self.group.attention[0] = now + _ATTENTION
            for link in self.gcs_links:
                link.attend()
            self.write_if_held()
            self.warn_if_stalled()
            if self.setting.lockstep:
                self.neighbourhood.send_again_if_stalled(int(self.group.done.sum()))
            self.neighbourhood.report_network(self.now_us)
            self.neighbourhood.report_refusals()

    def write_if_held(self) -> None:
        """Write what has been recorded when the swarm is held, for who looks now."""
        if not self.gate.open(int(self.group.done.max()) + 1):
            for recorder in (self.recorder, self.link_recorder):
                if recorder.rows.filled.any():
                    recorder.write()
            self.lie_recorder.write()

    def warn_if_stalled(self) -> None:
        """Log what this process waits for, where it has waited for long."""
        progress, tick = int(self.group.done.sum()), int(self.group.done.max()) + 1
        if progress != self.progress or not self.setting.lockstep or not self.gate.open(tick):
            self.progress = progress
            self.stall.progress()
        elif self.stall.long:
            pending = zip(self.specs, self.group.pending, strict=True)
            missing = [f"the state of UAV {spec.uav}" for spec, tick in pending if tick < 0]
            waits_for = ", ".join(missing) or self.neighbourhood.missing()
            self.gate.report(
                EventReport("warning", f"autopilots of UAV {self.names} at tick {tick} wait for {waits_for}")
            )

    progress = -1
    """Ticks of all at the last look."""

    def read_datagram(self) -> None:
        """Read the datagram at hand, which only pymavlink can."""
        wire = self.group.wire
        i = int(wire.whose[0])
        for message in split(wire, self.vehicles[i].codec):
            if message is None:
                if self.group.pending[i] < 0:
                    self.flight.take(self.group, self.timing, i)
            elif ends(message):
                self.group.alive[i] = 0
                self.gcs_links[i].end()
            elif message.get_type() == "COMMAND_ACK":
                self.gcs_links[i].take_vehicle_answer(message)
                self.send_telemetry_soon()

    @property
    def now_us(self) -> int:
        """Simulated time of the last tick that any of them flew, us."""
        return max(0, int(self.group.done.max())) * self.timing.period_us

    @property
    def names(self) -> str:
        return ", ".join(str(spec.uav) for spec in self.specs)

    def end(self) -> None:
        """Release all who wait for this process, write what it has recorded, and wait until all have ended."""
        self.group.alive[:] = 0
        self.neighbourhood.report_network(self.now_us, last=True)
        self.neighbourhood.report_refusals(last=True)
        self.neighbourhood.end()
        for link in self.gcs_links:
            link.end()
        self.recorder.close()
        self.link_recorder.close()
        self.lie_recorder.close()
        for spec, link in zip(self.specs, self.gcs_links, strict=True):
            dropped = {reason: count for reason, count in link.dropped().items() if count}
            if dropped:
                listed = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in dropped.items())
                self.gate.report(EventReport("info", f"dropped what came from the ground: {listed}", spec.uav))
        flown = int(self.group.done.max()) + 1
        self.gate.report(Ended(flown, 0, flown * len(self.specs)))
        until = time.monotonic() + _UNTIL_RELEASED
        while not self.gate.released and time.monotonic() < until:
            # The last command may be lost on its way, between computers for instance: its vehicle waits for it.
            for i in range(len(self.specs)):
                send_again(self.group.wire, i)
            self.gate.wait_until_released(RESEND)

    def close(self) -> None:
        """Free the ports; leave the mesh."""
        for vehicle in self.vehicles:
            vehicle.close()
        for link in self.gcs_links:
            link.close()
        self.neighbourhood.close()
        self.waiter.close()
