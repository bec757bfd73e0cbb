"""A user's own PX4: found by its path, started once for each aircraft in a folder of its own, and ended."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ftcc.groundside.doors.preparing import DoorError

__all__ = ["Programs", "Px4Build", "find_px4", "instance_of"]

_MODELS = ("ftcc_plane", "jsbsim_malolo", "plane")
"""Airframes of PX4 that fit, the best first."""
_OTHER_SIMULATORS = ("PX4_SIMULATOR", "PX4_SIM_HOSTNAME", "PX4_SIM_HOST_ADDR", "PX4_SYS_AUTOSTART")
"""What a user's shell may hold for another simulator, and must not choose ours: its kind, host and airframe."""
_LAST_INSTANCE = 254
"""MAV_SYS_ID is the instance + 1, up to 255."""
_END = 3.0
"""Time to end by itself, wall s."""


@dataclass(frozen=True)
class Px4Build:
    """A PX4 for software in the loop."""

    program: Path
    etc: Path
    """Its start scripts: the folder etc of its root file system."""
    model: str
    """The airframe, PX4_SIM_MODEL."""


def find_px4(path: Path, model: str | None = None) -> Px4Build:
    """Find PX4 by the folder of its build, or by the program itself.

    Parameters
    ----------
    path : a folder with ``bin/px4`` and ``etc``, as ``build/px4_sitl_default``; or that ``px4``.
    model : airframe; default: the first one that PX4 has of ftcc_plane, jsbsim_malolo and plane.

    Raises
    ------
    DoorError
        If something is missing; nothing has been started.
    """
    program = path / "bin" / "px4" if path.is_dir() else path
    if not program.is_file():
        raise DoorError(
            f"--px4 {path}: {program} does not exist; give the folder of a build, as build/px4_sitl_default"
        )
    if not os.access(program, os.X_OK):
        raise DoorError(f"--px4 {path}: {program} is not executable")
    program = program.absolute()
    etc = program.parent.parent / "etc"
    scripts = etc / "init.d-posix"
    if not (scripts / "rcS").is_file():
        raise DoorError(f"--px4 {path}: {scripts / 'rcS'} does not exist; px4 must lie in bin beside its etc")
    # In folder airframes since 2020.
    names = sorted(
        file.name for folder in (scripts, scripts / "airframes") if folder.is_dir() for file in folder.iterdir()
    )
    had = [name for name in names if name.partition("_")[0].isdecimal()]
    for wanted in _MODELS if model is None else (model,):
        if any(name.partition("_")[2] == wanted for name in had):
            return Px4Build(program, etc, wanted)
    asked = f"none of {', '.join(_MODELS)}" if model is None else f"no {model}"
    raise DoorError(f"--px4 {path}: has {asked} among its airframes; docs/autopilots.md shows the file ftcc_plane")


def instance_of(uav: int) -> int:
    """Return the number of the PX4 that flies a UAV: its MAV_SYS_ID is then the UAV's id.

    Raises
    ------
    DoorError
        If PX4 has no such instance.
    """
    if not 1 <= uav <= _LAST_INSTANCE + 1:
        raise DoorError(f"UAV {uav}: PX4 has instances for the UAVs 1 to {_LAST_INSTANCE + 1}")
    return uav - 1


class Programs:
    """The running PX4 programs, by UAV."""

    def __init__(self, build: Px4Build) -> None:
        self.build = build
        self._running: dict[int, subprocess.Popen[bytes]] = {}

    def start(self, uavs: Sequence[int], folder: Path) -> None:
        """Start one for each UAV, in ``folder``/UAV; what it prints goes into ``px4.log`` there.

        Raises
        ------
        DoorError
            If the program cannot be started; those before it have been ended.
        """
        for uav in uavs:
            own = folder / str(uav)
            own.mkdir(parents=True)
            # -d: no shell; the last argument is where the start scripts are.
            command = [str(self.build.program), "-i", str(instance_of(uav)), "-d", str(self.build.etc)]
            environment = {name: value for name, value in os.environ.items() if name not in _OTHER_SIMULATORS}
            environment["PX4_SIM_MODEL"] = self.build.model
            try:
                with (own / "px4.log").open("wb") as log:
                    self._running[uav] = subprocess.Popen(
                        command,
                        cwd=own,
                        env=environment,
                        stdin=subprocess.DEVNULL,
                        stdout=log,
                        stderr=subprocess.STDOUT,
                        # Ctrl-C is for us: PX4 is ended after its last sample.
                        start_new_session=True,
                    )
            except OSError as error:
                self.end()
                raise DoorError(f"{self.build.program}: cannot be started: {error.strerror or error}") from None

    def ended(self) -> dict[int, str]:
        """Return how those ended that have ended, by UAV."""
        codes = {uav: program.poll() for uav, program in self._running.items()}
        return {uav: f"PX4 ended with exit code {code}; see px4.log" for uav, code in codes.items() if code is not None}

    def end(self) -> None:
        """End all, with what they have started."""
        for program in self._running.values():
            _signal(program, signal.SIGTERM)
        until = time.monotonic() + _END
        for program in self._running.values():
            with contextlib.suppress(subprocess.TimeoutExpired):
                program.wait(max(0.0, until - time.monotonic()))
            # Also what an ended one left behind in its group.
            _signal(program, signal.SIGKILL)
            program.wait()


def _signal(program: subprocess.Popen[bytes], number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(program.pid, number)
