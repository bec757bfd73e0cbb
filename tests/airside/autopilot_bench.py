"""A real autopilot process for one UAV, alone, with a test in the place of its vehicle."""

from __future__ import annotations

import threading
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.airside.process import AutopilotProcess
from ftcc.airside.scheme import Flight
from ftcc.airside.spec import DefenceSpec, DiagnosisSpec, Neighbour
from ftcc.link.gate import Gate, Go, Limit, Pace, Release, Stop
from ftcc.link.mavlink import LOOPBACK, SIMULATOR, STATION, Endpoint
from ftcc.link.messages import StateMessage
from ftcc.link.ports import reserve
from ftcc.link.process import Setting
from tests.support.pymavlink_wire import read_command, read_target, state_messages
from tests.support.swarm import GRAPH, LEADERS, autopilot, timing

FLIGHT = Flight(GRAPH, 0.01, 0.05, 0.05, 2.0, False)
"""What the law's conditions are checked against."""

_NO_DIAGNOSIS, _NO_DEFENCE = DiagnosisSpec(), DefenceSpec()


def forged(z: float, V: float, gamma: float, theta: float, q: float) -> np.ndarray:
    """State messages of an aircraft that does not exist."""
    values = dict.fromkeys(StateMessage._fields, 0.0)
    values |= {"q1": np.cos(theta / 2), "q3": np.sin(theta / 2), "pitchspeed": q, "z": -z}
    values |= {"vx": V * np.cos(gamma), "vz": -V * np.sin(gamma)}
    return np.array(list(values.values())).astype(np.float32).astype(np.float64)


class Bench:
    """The process, its sockets and its gate; as a context it flies in a thread. Its ``neighbours`` send nothing."""

    def __init__(
        self,
        folder: Path,
        ticks: int,
        lockstep: bool = True,
        neighbours: tuple[int, ...] = (),
        uav: int = 1,
        diagnosis: DiagnosisSpec = _NO_DIAGNOSIS,
        defence: DefenceSpec = _NO_DEFENCE,
        **setting: Any,
    ) -> None:
        self.uav = uav
        uavs = (uav, *neighbours)
        self.block = reserve(uavs)
        ports = self.block.of(uav)
        self.timing = timing("flight", ticks / 100)
        every = {uav: self.block.of(uav) for uav in uavs}
        alone = {uav: uav for uav in uavs}
        shared = Setting("test", self.timing, lockstep, every, alone, self.block.station, folder, **setting)
        self.launcher, pipe = Pipe()
        self.vehicle = Endpoint(uav, SIMULATOR, ports.vehicle, (LOOPBACK, ports.autopilot))
        self.station = Endpoint(STATION, 1, self.block.station)
        edges = tuple(Neighbour(other, 0.5) for other in neighbours)
        spec = autopilot(uav, neighbours=edges, flight=FLIGHT, diagnosis=diagnosis, defence=defence)
        # Nobody waits for neighbours that are not there.
        self.process = AutopilotProcess([spec], shared, Gate(pipe, gone=set(neighbours)))
        self._thread = threading.Thread(target=self.process.fly)

    def __enter__(self) -> Bench:
        self.launcher.send(Go(Pace(0.0, 0, 1.0), Limit(None)))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.launcher.send(Stop())
        self.launcher.send(Release())
        self._thread.join(20.0)
        assert not self._thread.is_alive()

    def close(self) -> None:
        """Free the ports."""
        self.process.close()
        self.vehicle.close()
        self.station.close()
        self.block.release()

    def answer(self, tick: int, state: np.ndarray, controls: np.ndarray, *more: object) -> np.ndarray:
        """The command (fractions of travel), or a leader's target, that answers a state."""
        stamp = tick * self.timing.period_us
        command, read = (np.zeros(7), read_target) if self.uav in LEADERS else (np.zeros(4), read_command)
        for _ in range(100):
            if more:
                self.vehicle.send(*more)
            self.vehicle.send(*state_messages(stamp, state, controls))
            for _ in range(200):
                for message in self.vehicle.receive():
                    if read(message, command) == stamp:
                        return command
                threading.Event().wait(0.0005)
        raise AssertionError(f"no answer to the state of tick {tick}")
