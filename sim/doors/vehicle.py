"""An aircraft behind a door: at rest on a simplified launcher, launched, then flown by the plant of its scenario."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import ACTUATORS, THRUST, decode_command
from ftcc.link.home import Home
from ftcc.link.recording import Recorder, is_full, part_path
from ftcc.link.rotation import body_attitude, body_axes
from ftcc.link.timing import Timing
from ftcc.sim.actuation import NO_AUTOTHROTTLE, latch
from ftcc.sim.build import build_fleet
from ftcc.sim.doors.sensors import Motion, Readings, Sensors, Sizes
from ftcc.sim.obstacles import clearance
from ftcc.sim.plant import ALPHA, BETA, CHI, GAMMA, LOST, MU, TRUTH, P, Q, R, V, X, Y, Z
from ftcc.sim.plants import conditions_of, cycle_of, find
from ftcc.sim.process import columns, places
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.wind import NO_TURBULENCE, wind_speed

__all__ = ["LAUNCH_US", "UNSERVED", "DoorVehicle", "why_unserved"]

LAUNCH_US = 2_000_000
"""Time that a launch takes, us: to 30 m/s at 15 m/s^2, on 30 m."""
_BEFORE_FLIGHT = -1.0
"""Scenario time on the launcher, s: no planned fault acts yet."""

UNSERVED = "needs a plant with aileron, elevator, rudder and thrust"


def why_unserved(spec: VehicleSpec, step_us: int, grid_us: int) -> str:
    """Why this aircraft cannot fly behind a door whose steps are multiples of ``grid_us`` (us); empty if it can."""
    plant = find(spec.plant)
    if set(plant.ACTUATORS) != set(ACTUATORS) or not {"g", "rho"} <= set(plant.Parameters._fields):
        return f"plant {spec.plant} has {', '.join(plant.ACTUATORS)}; another autopilot {UNSERVED} (plant.model)"
    if grid_us % step_us and spec.turbulence != NO_TURBULENCE:
        return f"rates.plant_step {step_us / 1e6:g} s must divide {grid_us / 1e6:g} s where there is turbulence"
    return ""


class DoorVehicle:
    """One aircraft, stepped by the clock of its door.

    The start is simplified: plants cannot stand on the ground, but estimators of attitude align at rest. Therefore the
    aircraft rests, in the attitude of its start, on a launcher without mass, friction or play. `launch` accelerates it
    evenly along its path, so that it reaches position and speed of the scenario's start after `LAUNCH_US`. There the
    scenario begins: time 0, disturbances, planned faults. On the launcher actuators follow commands at once.

    Parameters
    ----------
    spec, timing : as of the vehicle process; the period is set later, see `set_period`.
    home : the origin of the local frame on earth.
    sizes : of the sensors' errors.
    folder : of the run, for the recording; None: nothing is recorded.
    on_trouble : called if the recording cannot be written any further.
    """

    def __init__(
        self,
        spec: VehicleSpec,
        timing: Timing,
        home: Home,
        sizes: Sizes,
        folder: Path | None,
        on_trouble: Callable[[str], None],
    ) -> None:
        self.spec = replace(spec, autothrottle=NO_AUTOTHROTTLE)
        self.uav, self.home = spec.uav, home
        self.period_us = self.step_us = timing.step_us
        self._wanted_step, self._record_us = timing.step_us, timing.record_every * timing.period_us
        self._record_every = 1
        self._plant, self._cycle = find(spec.plant), cycle_of(spec.plant)
        _load_compiled(self.spec, timing.step_us)
        self.fleet = build_fleet([self.spec])
        self._sensors = Sensors(spec.uav, timing.seed, home, sizes)
        self._parameters = self._plant.Parameters(*spec.airframe)
        self.now_us = 0
        """Simulated time since the door opened, us: the autopilot's clock."""
        self.launched_us: int | None = None
        """Time since the launch began, us."""
        self.sample = 0
        """Number of the state at hand."""
        self.lost = ""
        """Why it is lost; empty: it is not."""
        self.true: NDArray[np.float64] = np.zeros(len(TRUTH))
        self._before: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]] | None = None
        self._start: NDArray[np.float64] = np.zeros(len(TRUTH))
        self._command: NDArray[np.float64] = np.zeros(len(ACTUATORS))
        self._recorder = None
        if folder is not None:
            obstacles = bool(spec.obstacles)
            self._recorder = Recorder(
                [part_path(folder, spec.uav, "vehicle")],
                columns(spec.plant, obstacles),
                places(spec.plant, obstacles),
                on_trouble=on_trouble,
            )
        self._cycle.actuate(self.fleet, 0, _BEFORE_FLIGHT)
        self._cycle.truth(self.fleet, 0, 0.0, self._start)
        self._observe()

    def set_period(self, wanted_us: int, exactly: bool) -> None:
        """Choose the time between two exchanges (us): ``wanted_us``, or the nearest number of the plant's steps."""
        if exactly:
            self.step_us = math.gcd(self._wanted_step, wanted_us)
            self.period_us = wanted_us
        else:
            self.step_us = self._wanted_step
            self.period_us = max(1, round(wanted_us / self.step_us)) * self.step_us
        self._record_every = max(1, round(self._record_us / self.period_us))
        modelled = self.spec.flown
        if modelled is not None and modelled.step_us != self.step_us:
            # An outside model goes by its own step, whatever it is asked for.
            self.spec = replace(self.spec, flown=replace(modelled, step_us=self.step_us))
            self.fleet = build_fleet([self.spec])
            self._cycle.actuate(self.fleet, 0, _BEFORE_FLIGHT)

    @property
    def flying(self) -> bool:
        """Whether it has left the launcher."""
        return self.launched_us is not None and self.launched_us >= LAUNCH_US

    @property
    def flown_us(self) -> int:
        """Time of the scenario, us; 0 on the launcher."""
        return self.launched_us - LAUNCH_US if self.launched_us is not None and self.flying else 0

    def launch(self) -> None:
        """Begin the launch."""
        self.launched_us = 0

    def advance(self, controls: NDArray[np.float64]) -> None:
        """Step one period with ``controls`` (4,), fractions of travel in the order of ``ACTUATORS``."""
        fleet = self.fleet
        decode_command(controls, fleet.travel[0], self._command)
        latch(fleet, 0, self._command)
        if self.flying:
            why = self._cycle.advance(fleet, 0, self.flown_us, self.period_us, self.step_us)
            self.lost = LOST[why]
        else:
            fleet.position[0] = np.clip(fleet.command[0], fleet.limits[0, :, 0], fleet.limits[0, :, 1])
        if self.launched_us is not None:
            was_flying = self.flying
            self.launched_us += self.period_us
            if self.flying and not was_flying:
                # A launch takes whole periods: the scenario begins with the first state after it.
                self.launched_us = LAUNCH_US
        self.now_us += self.period_us
        self.sample += 1
        self._observe()

    def _observe(self) -> None:
        """Find truth and motion of this sample, and record them."""
        time = self.flown_us / 1e6 if self.flying else _BEFORE_FLIGHT
        self._cycle.actuate(self.fleet, 0, time)
        if self.flying:
            self._cycle.truth(self.fleet, 0, time, self.true)
            self._record(time)
        else:
            self._on_launcher()
        self.motion = self._moved()

    def _on_launcher(self) -> None:
        """Truth on the launcher: attitude and path of the start, at a part of its speed."""
        start, true = self._start, self.true
        share = (self.launched_us or 0) / LAUNCH_US
        back = 0.5 * start[V] * LAUNCH_US / 1e6 * (1.0 - share * share)
        true[:] = start
        true[X] -= back * math.cos(start[GAMMA]) * math.cos(start[CHI])
        true[Y] -= back * math.cos(start[GAMMA]) * math.sin(start[CHI])
        true[Z] -= back * math.sin(start[GAMMA])
        true[V] = start[V] * share
        true[P] = true[Q] = true[R] = 0.0

    def _moved(self) -> Motion:
        """The motion since the last sample: rates and specific force are means, as integrating sensors give them."""
        true: list[float] = self.true.tolist()
        now = body_attitude(true[CHI], true[GAMMA], true[MU], true[ALPHA], true[BETA])
        cos_gamma = math.cos(true[GAMMA])
        velocity = (
            true[V] * cos_gamma * math.cos(true[CHI]),
            true[V] * cos_gamma * math.sin(true[CHI]),
            -true[V] * math.sin(true[GAMMA]),
        )
        rates = (true[P], true[Q], true[R])
        before = self._before or (now, velocity, rates)
        self._before = now, velocity, rates
        seconds = self.period_us / 1e6
        felt = [(b - a) / seconds for a, b in zip(before[1], velocity, strict=True)]
        felt[2] -= self._parameters.g
        return Motion(
            quaternion=now,
            rates=_mean(before[2], rates),
            force=_turned(felt, _between(before[0], now)),
            position=(true[X], true[Y], true[Z]),
            velocity=velocity,
            airspeed=self._airspeed(true, velocity),
            density=self._parameters.rho,
        )

    def _airspeed(self, true: list[float], velocity: tuple[float, float, float]) -> float:
        """Speed through the air, m/s; on the launcher the air is at rest."""
        if not self.flying:
            return true[V]
        air = dict(zip(self._plant.Disturbances._fields, self.fleet.disturbed[0].tolist(), strict=True))
        along, right = air.get("wind_along", 0.0), air.get("wind_right", 0.0)
        cos_chi, sin_chi = math.cos(true[CHI]), math.sin(true[CHI])
        north = wind_speed(true[Z], air.get("wind", 0.0), air.get("gust", 0.0)) + along * cos_chi - right * sin_chi
        east = along * sin_chi + right * cos_chi
        up = air.get("wind_up", 0.0)
        return math.sqrt((velocity[0] - north) ** 2 + (velocity[1] - east) ** 2 + (velocity[2] + up) ** 2)

    def read_sensors(self) -> Readings:
        """Return what the sensors show of this sample."""
        return self._sensors.read(self.sample, self.now_us, self.motion)

    @property
    def throttle_travel(self) -> float:
        """Full thrust, N."""
        return float(self.fleet.travel[0, THRUST])

    def _record(self, time: float) -> None:
        if self._recorder is None or (self.flown_us // self.period_us) % self._record_every:
            return
        rows = self._recorder.rows
        row = rows.values[0, rows.filled[0]]
        row[0], row[1] = time, float(self.uav)
        acting, conditions = 2 + len(TRUTH) + len(ACTUATORS), 2 + len(TRUTH) + 2 * len(ACTUATORS)
        row[2 : 2 + len(TRUTH)] = self.true
        row[2 + len(TRUTH) : acting] = self.fleet.command[0]
        row[acting:conditions] = self.fleet.acting[0]
        self._cycle.conditions(self.fleet, 0, time, row[conditions:])
        if self.spec.obstacles:
            row[-1] = clearance(self.fleet.zones, self.true[X], self.true[Z])
        rows.filled[0] += 1
        if is_full(rows):
            self._recorder.write()

    def close(self) -> None:
        """End the recording."""
        if self._recorder is not None:
            self._recorder.close()


def _load_compiled(spec: VehicleSpec, step_us: int) -> None:
    """Load, or compile, what a step needs before an autopilot waits for it."""
    fleet, cycle = build_fleet([spec]), cycle_of(spec.plant)
    latch(fleet, 0, fleet.command[0].copy())
    cycle.advance(fleet, 0, 0, step_us, step_us)
    cycle.conditions(fleet, 0, 0.0, np.zeros(len(conditions_of(spec.plant))))


Quaternion = tuple[float, float, float, float]


def _between(a: tuple[float, ...], b: tuple[float, ...]) -> Quaternion:
    """The attitude half way between two near ones, whatever their signs."""
    sign = 1.0 if sum(x * y for x, y in zip(a, b, strict=True)) >= 0.0 else -1.0
    added = [sign * x + y for x, y in zip(a, b, strict=True)]
    length = math.sqrt(sum(x * x for x in added))
    q0, q1, q2, q3 = (x / length for x in added)
    return q0, q1, q2, q3


def _turned(vector: list[float], quaternion: Quaternion) -> tuple[float, float, float]:
    """A vector north, east, down in body axes."""
    first, second, third = (sum(a * b for a, b in zip(axis, vector, strict=True)) for axis in body_axes(*quaternion))
    return first, second, third


def _mean(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, float, float]:
    first, second, third = (0.5 * (x + y) for x, y in zip(a, b, strict=True))
    return first, second, third
