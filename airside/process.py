"""The autopilot process: one or several autopilots of a swarm, each a tick per state that its vehicle sends.

A tick, from the datagram of a state to that of the command that answers it, is compiled: `flight` lists its stages.
Here is what happens beside the ticks: transmissions over the mesh, the recording, the ground, the launcher. In lockstep
an autopilot waits for every record that could be usable at its tick and never runs ahead of those who hear it; on the
wall clock it works on every state that arrives and on the newest records it has.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from types import ModuleType

from ftcc.airside.autopilots import tick_of, told
from ftcc.airside.gcs import AutopilotView, GcsLink
from ftcc.airside.group import GIVE_UP, NOTE, PUBLISH, REPORT, SECOND, WRITE, AutopilotGroup, build_group, flight_of
from ftcc.airside.neighbourhood import Neighbourhood
from ftcc.airside.schemes import find
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.compiled import entry_of
from ftcc.link.gate import Ended, Gate, Ready, Said
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, Endpoint, ending_message, ends
from ftcc.link.process import Setting, Stall, Waiter
from ftcc.link.recording import LINK_COLUMNS, Column, Recorder, part_path
from ftcc.link.timing import Timing
from ftcc.link.waiting import ATTEND, DATAGRAM, FLOWN, MAIL, WORK
from ftcc.link.wire import connect, keep_sent, send_again, split

__all__ = ["AutopilotProcess", "columns", "load_compiled", "main"]

_ATTENTION = 0.02
"""Wall time between two looks at what the ground waits for, s."""
_MEETING = 0.02
"""Between two looks whether all neighbours are there, s."""


def columns(scheme: str) -> tuple[Column, ...]:
    """Columns of an autopilot's part of the recording."""
    signals = (Column(s.name, s.unit, s.meaning) for s in find(scheme).signals)
    return (Column("t", "s", "simulated time"), Column("uav", "-", "id"), *signals)


def main(specs: Sequence[AutopilotSpec], setting: Setting, gate: Gate) -> None:
    """Fly the autopilots of this process from the launcher's go to its release."""
    process = AutopilotProcess(specs, setting, gate)
    refusal = tick_of(specs[0].scheme).REFUSAL
    try:
        if refusal and specs[0].uav == min(setting.ports):
            # One process speaks for all.
            gate.tell(Said("warning", refusal))
        process.wait_for_neighbours()
        gate.tell(Ready())
        gate.wait_until_go()
        process.fly()
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
        self.specs = specs
        self.setting = setting
        self.timing = setting.timing
        self.gate = gate
        self.flight = flight_of(specs[0].scheme)
        self.recorder = Recorder(
            [part_path(setting.folder, s.uav, "autopilot") if s.role == "follower" else None for s in specs],
            columns(specs[0].scheme),
            on_trouble=self.report_trouble,
        )
        self.link_recorder = Recorder(
            [part_path(setting.folder, s.uav, "links") if s.neighbours else None for s in specs],
            LINK_COLUMNS,
            on_trouble=self.report_trouble,
        )
        self.group = build_group(specs, self.timing, self.recorder.rows, self.link_recorder.rows)
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
        for link in self.gcs_links:
            for socket in link.sockets:
                self.waiter.add(socket, partial(link.listen, socket))
        # In real time nobody waits for records: what has come is taken before the next tick.
        mesh = self.neighbourhood.fileno() if setting.lockstep else -1
        connect(self.group.wire, self.vehicles, self.waiter.fileno(), mesh)
        self.stall = Stall()
        self._fly = entry_of(self.flight.fly, self.group, self.timing, setting.lockstep)

    def report_trouble(self, text: str) -> None:
        """Tell that something cannot be recorded."""
        self.gate.tell(Said("error", text))

    def view(self, i: int) -> AutopilotView:
        """What the side towards the ground sees of autopilot ``i``."""
        return AutopilotView(
            spec=self.specs[i],
            i=i,
            setting=self.setting,
            scheme=find(self.specs[i].scheme),
            autopilots=self.group.autopilots,
            inbox=self.group.inbox,
            link_events=self.group.events,
            state=self.group.states[i],
            controls=self.group.controls[i],
            vehicle=self.vehicles[i],
            send_to_launcher=self.gate.tell,
            done=self.group.done[i : i + 1],
        )

    def wait_for_neighbours(self) -> None:
        """Wait until all who hear this process's UAVs have subscribed."""
        self.stall.progress()
        while not self.neighbourhood.ready and not self.gate.stopping:
            self.waiter.wait(_MEETING)
            if self.stall.long:
                self.gate.tell(Said("warning", f"mesh: still waiting for {self.neighbourhood.awaited}"))

    def fly(self) -> None:
        """All ticks, or until everybody is lost or the launcher stops the flight."""
        cause = ATTEND
        while cause != FLOWN:
            if cause == DATAGRAM:
                self.take_datagram()
            elif cause == MAIL:
                self.neighbourhood.take()
            elif cause == WORK:
                self.work()
            else:
                self.attend()
            if self.gate.stopping:
                break
            cause = self._fly(self.group, self.timing, self.setting.lockstep)
        self.end()

    # What is to be done after a tick.

    def work(self) -> None:
        """Put a transmission on the mesh, write rows, tell what happened and what the ground wants to hear."""
        to_do = int(self.group.to_do[0])
        if to_do & PUBLISH:
            self.neighbourhood.publish()
        if to_do & GIVE_UP:
            self.give_up()
        if to_do & WRITE:
            self.recorder.write()
            self.link_recorder.write()
        if to_do & SECOND:
            self.recorder.write_if_due()
            self.link_recorder.write_if_due()
        if to_do & NOTE:
            for at_us, uav, severity, text in told(self.group.autopilots, self.specs):
                self.gate.tell(Said(severity, text, uav, at_us))
        if to_do & (REPORT | SECOND):
            # What the log has of each simulated second is sent when this process is awake anyhow.
            self.report()

    def report(self) -> None:
        """Tell the ground what is due, and when something will be due next."""
        group = self.group
        for i, link in enumerate(self.gcs_links):
            if group.active[i]:
                link.report(int(group.done[i]) * self.timing.period_us)
        flying = [link for link in self.gcs_links if link.view.alive]
        group.report_us[0] = min((link.next_us for link in flying), default=0)
        group.report_wall[0] = min((link.next_wall for link in flying), default=0.0)

    def report_soon(self) -> None:
        """Look after the next tick what is due."""
        self.group.report_us[0], self.group.report_wall[0] = 0, 0.0

    def give_up(self) -> None:
        """The law of some UAVs gave no finite command: tell their vehicles, and end them."""
        if self.group.unsendable[0]:
            raise ValueError(f"UAV {self.names}: a value that was to be sent is not finite")
        self.group.given_up[0] = 0
        for i, link in enumerate(self.gcs_links):
            if not self.group.alive[i] and link.view.alive:
                keep_sent(self.group.wire, i, self.vehicles[i].pack(ending_message()))
                send_again(self.group.wire, i)
                link.end()

    # What surrounds the ticks.

    def attend(self) -> None:
        """What the launcher says and the ground asks, whether the swarm flies or is held."""
        if self.waiter.wait(0.0):
            # What was asked may have changed what is due when; who has died is not waited for.
            self.report_soon()
            self.neighbourhood.take()
        now = time.monotonic()
        if now >= self.group.attention[0]:
            self.group.attention[0] = now + _ATTENTION
            for link in self.gcs_links:
                link.attend()
            self.complain()

    def complain(self) -> None:
        """Say for what this process waits, where it has waited for long."""
        progress, tick = int(self.group.done.sum()), int(self.group.done.max()) + 1
        if progress != self.progress or not self.setting.lockstep or not self.gate.open(tick):
            self.progress = progress
            self.stall.progress()
        elif self.stall.long:
            pending = zip(self.specs, self.group.pending, strict=True)
            missing = [f"the state of UAV {spec.uav}" for spec, tick in pending if tick < 0]
            waits_for = ", ".join(missing) or self.neighbourhood.missing()
            self.gate.tell(Said("warning", f"autopilots of UAV {self.names} at tick {tick} wait for {waits_for}"))

    progress = -1
    """Ticks of all at the last look."""

    def take_datagram(self) -> None:
        """Take in the datagram at hand, which only pymavlink reads."""
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
                self.report_soon()

    @property
    def names(self) -> str:
        return ", ".join(str(spec.uav) for spec in self.specs)

    def end(self) -> None:
        """Nobody must wait for this process; what it has recorded is written; it goes when all have ended."""
        self.group.alive[:] = 0
        self.neighbourhood.end()
        for link in self.gcs_links:
            link.end()
        self.recorder.close()
        self.link_recorder.close()
        for spec, link in zip(self.specs, self.gcs_links, strict=True):
            dropped = {reason: count for reason, count in link.dropped().items() if count}
            if dropped:
                listed = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in dropped.items())
                self.gate.tell(Said("info", f"dropped what came from the ground: {listed}", spec.uav))
        flown = int(self.group.done.max()) + 1
        self.gate.tell(Ended(flown, 0, flown * len(self.specs)))
        self.gate.wait_until_released(60.0)

    def close(self) -> None:
        """Free the ports; leave the mesh."""
        for vehicle in self.vehicles:
            vehicle.close()
        for link in self.gcs_links:
            link.close()
        self.neighbourhood.close()
        self.waiter.close()
