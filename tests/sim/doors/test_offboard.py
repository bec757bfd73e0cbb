"""The bridge to PX4's offboard mode, with a player of PX4: a law over our wire flies the plant through PX4's loop."""

from __future__ import annotations

import math
import select
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, Endpoint
from ftcc.link.messages import StateMessage
from ftcc.link.ports import PortError
from ftcc.link.wire import connect, new_wire, read_state, receive_datagram, send_attitude_target
from ftcc.sim.doors.channels import PX4
from ftcc.sim.doors.flight import DoorFlight
from ftcc.sim.doors.offboard import Offboard, mode_name
from ftcc.sim.doors.px4 import Px4Door
from tests.sim.doors.bench import ROOT, a_vehicle, mission
from tests.support.ports import free_port


def bank_of(t: float) -> float:
    """The reference of this test's law, rad: level for 5 s, then right and left."""
    return 0.0 if t < 5.0 else 0.25 * math.sin(2.0 * math.pi * (t - 5.0) / 12.5)


def quaternion(roll: float, pitch: float, yaw: float) -> list[float]:
    c, s = zip(*((math.cos(0.5 * a), math.sin(0.5 * a)) for a in (roll, pitch, yaw)))
    return [
        c[0] * c[1] * c[2] + s[0] * s[1] * s[2],
        s[0] * c[1] * c[2] - c[0] * s[1] * s[2],
        c[0] * s[1] * c[2] + s[0] * c[1] * s[2],
        c[0] * c[1] * s[2] - s[0] * s[1] * c[2],
    ]


class Law:
    """An autopilot's end of our wire: answers each state with an attitude target for bank, 1000 m and 30 m/s."""

    def __init__(self, port: int, peer: int, silent_from: float = math.inf) -> None:
        self.endpoint = Endpoint(1, AUTOPILOT, port, (LOOPBACK, peer))
        self.wire = new_wire([1], AUTOPILOT)
        # Compiled here, and nothing is sent: there is no state, and nan is no target.
        read_state(self.wire, np.zeros(len(StateMessage._fields)), np.zeros(4))
        send_attitude_target(self.wire, 0, 0, np.full(5, math.nan))
        connect(self.wire, [self.endpoint], -1)
        self.silent_from = silent_from
        self.seen: dict[int, np.ndarray] = {}
        """By stamp (us)."""
        self.over = False
        self._thread = threading.Thread(target=self.run)

    def __enter__(self) -> Law:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.over = True
        self._thread.join()
        self.endpoint.close()

    def run(self) -> None:
        state, controls = np.zeros(len(StateMessage._fields)), np.zeros(4)
        while not self.over:
            select.select([self.endpoint], [], [], 0.05)
            while receive_datagram(self.wire, 0):
                stamp, _ = read_state(self.wire, state, controls)
                if stamp >= 0:
                    self.seen[int(stamp)] = state.copy()
                    self.answer(int(stamp), StateMessage(*state.tolist()))

    def answer(self, stamp: int, state: StateMessage) -> None:
        if stamp / 1e6 > self.silent_from:
            return
        pitch = 0.06 + max(-0.15, min(0.15, 0.01 * (1000.0 + state.z) + 0.03 * state.vz))
        speed = math.hypot(state.vx, state.vy)
        thrust = max(0.0, min(1.0, 0.25 + 0.1 * (30.0 - speed)))
        target = np.array([*quaternion(bank_of(stamp / 1e6), pitch, math.atan2(state.vy, state.vx)), thrust])
        assert send_attitude_target(self.wire, 0, stamp, target)


class Flown:
    """A flight through the bridge."""

    def __init__(self, seconds: float, leave_at: float = math.inf, silent_from: float = math.inf) -> None:
        self.said: list[str] = []
        rows: list[np.ndarray] = []
        vehicle = a_vehicle()
        door = Px4Door(vehicle, free_port(), PX4, self.said.append)
        ports = [free_port() for _ in range(4)]
        timing = mission().timing._replace(period_us=20_000)
        bridge = Offboard(vehicle, timing, 0.0, ports[0], ports[1], ports[2], self.said.append)
        watch(vehicle, rows)
        command = [sys.executable, "-m", "tests.support.px4_offboard", *map(str, (door.port, ports[3], ports[0]))]
        with Law(ports[2], ports[1], silent_from) as law:
            player = subprocess.Popen([*command, str(leave_at)], cwd=ROOT)
            try:
                self.flight = DoorFlight(
                    [door], math.inf, round(seconds * 1e6), lambda text, _: self.said.append(text),
                    lambda: player.poll() is not None, {1: bridge},
                )  # fmt: skip
                self.flight.fly()
                bridge.close()
                door.close()
                assert player.wait(10.0) == 0
            finally:
                player.kill()
                player.wait()
        self.law, self.bridge, self.truth = law, bridge, np.array(rows)


def watch(vehicle, rows: list[np.ndarray]) -> None:
    advance: Callable[[np.ndarray], None] = vehicle.advance

    def and_note(controls: np.ndarray) -> None:
        advance(controls)
        if vehicle.flying:
            rows.append(vehicle.true.copy())

    vehicle.advance = and_note


@pytest.fixture(scope="module")
def flown() -> Flown:
    return Flown(30.0)


def test_a_law_of_ours_flies_the_plant_through_offboard_for_thirty_seconds(flown):
    """From rest on the launcher to a bank of 14 deg to both sides, at 1000 m, without a word of the test to PX4."""
    assert flown.flight.lost == {}
    truth, t = flown.truth, np.arange(len(flown.truth)) * 0.004
    assert len(truth) == 7501
    assert np.abs(truth[:, 2] - 1000.0).max() < 2.0
    settled = t > 8.0
    # The loop of the player has a time constant; against the reference 0.4 s before, what is left is small.
    reference = np.array([bank_of(moment - 0.4) for moment in t])
    assert np.abs(truth[settled, 6] - reference[settled]).max() < 0.08
    assert truth[settled, 6].max() > 0.18
    assert truth[settled, 6].min() < -0.18


def test_what_is_said_of_the_way_into_the_air(flown):
    assert flown.said[1:] == ["PX4 is in OFFBOARD", "is armed and gives thrust", "launch: the scenario begins in 2 s"]


def test_states_have_the_stamps_of_ticks_and_are_the_true_motion_at_that_time(flown):
    """Except for the units of HIL_STATE_QUATERNION (1 cm/s, 1e-7 deg), and PX4's stamps on its own grid of 4 ms."""
    stamps = np.array(list(flown.law.seen))
    assert stamps[0] <= 20_000
    assert np.all(stamps % 20_000 == 0)
    assert np.all(np.diff(stamps) > 0)
    assert len(stamps) > 0.9 * 1500
    states = np.array(list(flown.law.seen.values()))
    true = flown.truth[stamps // 4000]
    north, east, down = states[:, 7], states[:, 8], states[:, 9]
    assert np.abs(north - true[:, 0]).max() < 0.5
    assert np.abs(east - true[:, 1]).max() < 0.5
    assert np.abs(down + true[:, 2]).max() < 0.5
    assert np.abs(np.hypot(np.hypot(states[:, 10], states[:, 11]), states[:, 12]) - true[:, 3]).max() < 0.3


def test_px4_that_leaves_offboard_is_reported_by_mode_and_the_law_goes_on():
    flown = Flown(4.0, leave_at=6.0)
    left = "PX4 left OFFBOARD for MANUAL; the law's targets go on, PX4 does not fly them"
    assert left in flown.said
    assert "PX4 is in OFFBOARD again" not in flown.said
    assert max(flown.law.seen) > 3_500_000
    assert flown.flight.lost == {}


def test_a_law_that_falls_silent_is_reported_and_px4_leaves_offboard_by_its_own_clock():
    flown = Flown(4.0, silent_from=1.0)
    assert flown.said[-2:] == [
        "no target of the law for 0.2 s: PX4 will leave OFFBOARD",
        "PX4 left OFFBOARD for AUTO LOITER; the law's targets go on, PX4 does not fly them",
    ]
    assert flown.flight.lost == {}


def test_modes_are_named():
    assert [mode_name(mode) for mode in (6 << 16, 4 << 16 | 5 << 24, 1 << 16, 77 << 16)] == [
        "OFFBOARD", "AUTO RTL", "MANUAL", "mode 77",
    ]  # fmt: skip


def test_what_px4_refuses_is_reported_once_by_name():
    said: list[str] = []
    ports = [free_port() for _ in range(3)]
    bridge = Offboard(a_vehicle(), mission().timing, 0.0, *ports, said.append)
    mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    other = mavlink.MAVLink(None, srcSystem=2, srcComponent=1)
    denied = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 2)
    with closing(bridge), closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as px4:
        for sender in (other, mav, mav):
            px4.sendto(denied.pack(sender), (LOOPBACK, ports[0]))
        bridge.serve()
        assert said == ["PX4 refuses COMPONENT_ARM_DISARM: DENIED"]
        with pytest.raises(PortError, match=str(ports[0])):
            Offboard(a_vehicle(), mission().timing, 0.0, *ports, said.append)
