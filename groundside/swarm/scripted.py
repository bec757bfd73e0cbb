"""`Swarm`: a swarm of processes that a script flies and commands."""

from __future__ import annotations

import contextlib
import functools
import math
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results import Run
from ftcc.groundside.swarm.commanding import Commanding
from ftcc.groundside.swarm.control import Control, SwarmError, speed_factor
from ftcc.groundside.swarm.conversation import NoAnswerError, RefusedError
from ftcc.groundside.swarm.flight import fly_swarm
from ftcc.groundside.swarm.launcher import Outcome
from ftcc.groundside.swarm.preparing import check_choices, prepare_flight
from ftcc.groundside.swarm.registry import find_swarm
from ftcc.groundside.swarm.station import Station, VehicleState
from ftcc.link.recording import part_path, read_part

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission, Scenario, Settings

__all__ = ["Swarm"]

_LOOK = 0.02
"""Wall time between two looks at a swarm, s."""
_WRITTEN_WITHIN = 5.0
"""Wall time within which the processes of a held swarm have written what they recorded, s."""


class Swarm(Commanding):
    """A swarm of processes: what ``ftcc fly`` starts, and the commands to it.

    It starts with the ``with`` block (or `start`), held at t = 0, and ends with it (or `end`), also on an exception or
    Ctrl-C. In lockstep a flight depends on the scenario, its seed and the commands alone, each at its simulated time.

    Parameters
    ----------
    scenario : str, Path, Scenario or Mission
        As `simulate` takes it.
    folder : path, optional
        Of the run; default: ``runs/SCENARIO-TIME`` in the current folder.
    form, variants, settings, seed, duration
        See `load`.
    speed : float or "max"
        Largest number of simulated seconds per second.
    hold : bool
        Start held at t = 0, until `step`, `wait` or `resume`.
    clock, viewer, pack, port, mavlink, key, id_offset
        As the options of ``ftcc fly``; by default there is no viewer, and no ground station is sent anything.

    Raises
    ------
    UserError
        `ScenarioError`, `SwarmError` and others with the text that ``ftcc fly`` prints; nothing has been started.
    """

    def __init__(
        self,
        scenario: str | Path | Scenario | Mission = "demo",
        folder: str | Path | None = None,
        *,
        form: str | None = None,
        variants: str | Sequence[str] = (),
        settings: Settings = (),
        seed: int | None = None,
        duration: float | None = None,
        speed: float | str = 1.0,
        hold: bool = True,
        clock: str = "lockstep",
        viewer: str = "none",
        pack: int | str = 1,
        port: int | None = None,
        mavlink: Sequence[str] = ("none",),
        key: Path | None = None,
        id_offset: int = 0,
    ) -> None:
        from ftcc.groundside.scenario import mission_of

        factor = speed_factor(speed, "speed")
        check_choices(clock, factor, viewer)
        self.mission = mission_of(
            scenario, form=form, variants=variants, settings=settings, seed=seed, duration=duration
        )
        self._hold = hold
        self._options: dict[str, Any] = {
            "speed": factor, "hold": hold, "clock": clock, "viewer": viewer, "record_view": viewer != "none",
            "pack": pack, "port": port, "mavlink": mavlink, "key": key, "id_offset": id_offset,
        }  # fmt: skip
        self._given_folder = folder
        self._folder: Path | None = None
        self._thread: threading.Thread | None = None
        self._ready = threading.Event()
        self._outcome: Outcome | None = None
        self._error: BaseException | None = None
        self._reported: set[str] = set()
        """Processes that died, and of which an error has said so."""
        self._reported_law_error = False
        self._control: Control | None = None
        self._station: Station | None = None

    # Start and end.

    def start(self) -> Self:
        """Start all processes and wait until they are ready; the first start compiles.

        Raises
        ------
        UserError
            If the folder or the ports cannot be had, or the swarm was started before.
        SwarmError
            If a process dies at the start.
        TimeoutError
            If a process does not get ready.
        """
        if self._thread is not None:
            raise SwarmError("a Swarm flies once; make another one")
        options, ports = prepare_flight(self.mission, self._given_folder, **self._options)
        self._folder = options.folder

        def fly() -> None:
            try:
                self._outcome = fly_swarm(
                    self.mission, options, ports, lambda _: None, lambda *_: None, lambda _: self._ready.set()
                )
            except BaseException as error:
                self._error = error

        self._thread = threading.Thread(target=fly, name=f"swarm {options.folder.name}", daemon=True)
        self._thread.start()
        try:
            while not self._ready.wait(_LOOK) and not self.over:
                pass
            self._raise_what_went_wrong()
            if not self.over:
                entry = find_swarm(options.folder.name)
                self._control, self._station = Control(entry), Station(entry)
                self._look(self._control.status())
        except BaseException:
            self._stop()
            raise
        return self

    def end(self) -> Run:
        """End the flight, if it is not over, with all its processes; return its run.

        Raises
        ------
        SwarmError
            If a process died and no error has said so before; `run` is the run all the same.
        """
        self._stop()
        self._raise_what_went_wrong()
        return self.run

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop()
        if error is None:
            self._raise_what_went_wrong()

    def _stop(self) -> None:
        """Stop the flight and wait for its end."""
        thread = self._thread
        while thread is not None and thread.is_alive():
            # During the start the swarm listens to nobody for a moment.
            with contextlib.suppress(LookupError, OSError, RefusedError):
                Control(find_swarm(self.folder.name)).stop()
            thread.join(_LOOK)
        if self._station is not None:
            self._station.close()

    def _raise_what_went_wrong(self) -> None:
        if self._error is not None:
            raise self._error
        if self._outcome is not None:
            if self._outcome.law_error and not self._reported_law_error:
                self._reported_law_error = True
                raise SwarmError(self._outcome.law_error)
            self._look({"died": self._outcome.died})

    def _look(self, status: dict[str, Any]) -> None:
        """Raise `SwarmError` if a process has died, once for each."""
        new = [name for name in status["died"] if name not in self._reported]
        self._reported.update(new)
        if new:
            died = ", ".join(f"process {name} died" for name in new)
            raise SwarmError(f"{died}; see {self.folder / 'logs'}")

    # What is known of it.

    @property
    def folder(self) -> Path:
        """The folder of the run."""
        if self._folder is None:
            raise SwarmError("the swarm has not been started")
        return self._folder

    @property
    def run(self) -> Run:
        """The run; while the swarm flies, what has been written of it at the first access."""
        return Run(self.folder)

    @property
    def over(self) -> bool:
        """Whether the flight is over, by itself or by `end`."""
        return self._thread is not None and not self._thread.is_alive()

    @property
    def uavs(self) -> tuple[int, ...]:
        """Ids of the UAVs, ascending."""
        return tuple(sorted(self.mission.uavs))

    @property
    def time(self) -> float:
        """Simulated time, s: of a held swarm, of the next tick; of one that flies, of the newest report; at the end."""
        status = self._status()
        return self.run.end if status is None else float(status["t"])

    def vehicles(self) -> list[VehicleState | NoAnswerError]:
        """Return the state that each UAV reports over MAVLink, or the error if it does not answer."""
        return self.station.vehicles()

    def column(self, name: str, uav: int) -> NDArray[np.float64]:
        """Return what has been recorded so far of a column of one UAV, exactly as the run will have it.

        Of a swarm that is held, this is everything up to the last tick; of one that flies, up to about one second of
        wall time ago. It is read from the files of the processes, not from telemetry.

        Raises
        ------
        SwarmError
            If there is no such column or UAV.
        """
        if self.over:
            return self.run.column(name, uav)
        if uav not in self.mission.uavs:
            raise SwarmError(
                f"swarm {self.folder.name} has no UAV {uav}; its UAVs are {', '.join(map(str, self.uavs))}"
            )
        if name not in self._roles:
            raise SwarmError(f"swarm {self.folder.name} has no column {name!r}; there are {', '.join(self._roles)}")
        status = self._status()
        if status is None:
            return self.run.column(name, uav)
        rows = self._rows_at(float(status["t"])) if status["state"] == "held" else 0
        until = time.monotonic() + _WRITTEN_WITHIN
        while True:
            parts = {role: read_part(part_path(self.folder, uav, role)) for role in self._recorded_by(uav)}
            written = min(0 if part is None else len(part) for part in parts.values())
            # A UAV that was lost has fewer rows than the time says.
            if written >= rows or time.monotonic() > until or uav in self.run.lost:
                break
            time.sleep(_LOOK)
        part = parts.get(self._roles[name])
        if part is None or not written:
            # A leader has no law: in the run, too, its signals are nan.
            return np.full(written, np.nan)
        values: NDArray[np.float64] = part.column(name).to_numpy()[:written]
        return values

    @functools.cached_property
    def _roles(self) -> dict[str, str]:
        """The process that records it, by the name of a column."""
        from ftcc.airside.process import columns as autopilot_columns
        from ftcc.sim.process import columns as vehicle_columns

        mission = self.mission
        roles = {column.name: "autopilot" for column in autopilot_columns(mission.signals)}
        return roles | {column.name: "vehicle" for column in vehicle_columns(mission.plant, bool(mission.obstacles))}

    def _recorded_by(self, uav: int) -> list[str]:
        """The roles of the processes that record a UAV."""
        return ["vehicle"] if uav in self.mission.graph.leaders else ["vehicle", "autopilot"]

    def _rows_at(self, t: float) -> int:
        """Number of rows of a UAV when the swarm is held before the tick at ``t``."""
        ticks = round(t / self.mission.timing.period)
        return -(-ticks // self.mission.timing.record_every)

    def _status(self) -> dict[str, Any] | None:
        """The swarm's status; None if the flight is over."""
        status = None
        try:
            status = self._commanded().status()
        except OSError:
            self._wait_for_end()
        if self.over:
            self._raise_what_went_wrong()
        elif status is not None:
            self._look(status)
        return status

    def _commanded(self) -> Control:
        if self._control is None:
            raise SwarmError("the swarm is not flying")
        return self._control

    def _wait_for_end(self) -> None:
        """Wait for the end of a flight that answers no more: the run is being completed."""
        if self._thread is not None:
            self._thread.join()

    # The flow of time.

    def pause(self) -> float:
        """Hold the swarm, all vehicles before the same tick; return the simulated time, s. Does nothing if it is held.

        Raises
        ------
        SwarmError
            If a process has died.
        """
        return self._until_held(lambda control: control.pause())

    def step(self, ticks: int = 1) -> float:
        """Fly a held swarm for some ticks, hold it again, and return the simulated time, s.

        Raises
        ------
        RefusedError
            If it is not held.
        SwarmError
            If ``ticks`` is not positive, or a process has died.
        """
        if ticks < 1:
            raise SwarmError(f"step {ticks}: must be at least 1 tick")
        return self._until_held(lambda control: control.step(int(ticks)))

    def resume(self) -> None:
        """Let a held swarm fly on."""
        self._do(lambda control: control.resume())

    def speed(self, factor: float | str) -> None:
        """Set the largest number of simulated seconds per second, or "max"."""
        wanted = speed_factor(factor, "speed")
        self._do(lambda control: control.speed(wanted))

    def wait(self, t: float) -> float:
        """Return when simulated time ``t`` (s) is reached, or the flight is over; the result is the time then, s.

        A held swarm flies until it is held before the first tick at or after ``t``. A swarm that flies goes on flying.

        Raises
        ------
        SwarmError
            If ``t`` is not finite, or a process has died.
        """
        if not math.isfinite(t):
            raise SwarmError(f"wait {t}: must be a simulated time, s")
        while (status := self._status()) is not None:
            now = float(status["t"])
            if status["state"] == "held":
                period = self.mission.timing.period
                ticks = math.ceil(t / period - 1e-6) - round(now / period)
                return self.step(ticks) if ticks > 0 else now
            if status["state"] == "flying" and now >= t:
                return now
            time.sleep(_LOOK)
        return self.time

    def _do(self, command: Callable[[Control], None]) -> None:
        try:
            command(self._commanded())
        except OSError:
            self._wait_for_end()
            self._raise_what_went_wrong()
            raise SwarmError("the flight is over") from None

    def _until_held(self, command: Callable[[Control], None]) -> float:
        """Give a command after which the swarm will be held, and wait for that or the end of the flight."""
        self._do(command)
        try:
            return self._commanded().wait_until_held(look=self._look)
        except OSError:
            self._wait_for_end()
        return self.time

    @property
    def station(self) -> Station:
        """A ground station of this swarm, for every other command.

        Raises
        ------
        SwarmError
            If the swarm does not fly.
        """
        if self._station is None:
            raise SwarmError("the swarm is not flying")
        if self.over:
            raise SwarmError("the flight is over")
        return self._station
