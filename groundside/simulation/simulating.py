"""`simulate`: a scenario flown in this process, in memory or recorded; what ``ftcc simulate`` calls."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import overload

from ftcc.groundside.results import Run, RunError, reserved_folder
from ftcc.groundside.scenario import Mission, Scenario, Settings, mission_of
from ftcc.groundside.simulation.flight import Flight
from ftcc.groundside.simulation.one_process import LawError, Progress, fly_in_memory
from ftcc.groundside.simulation.to_disk import fly_to_disk

__all__ = ["simulate"]


@overload
def simulate(
    scenario: str | Path | Scenario | Mission,
    folder: None = None,
    progress: Progress | None = None,
    ready: Callable[[], None] | None = None,
    *,
    form: str | None = None,
    variants: str | Sequence[str] = (),
    settings: Settings = (),
    seed: int | None = None,
    duration: float | None = None,
) -> Flight: ...


@overload
def simulate(
    scenario: str | Path | Scenario | Mission,
    folder: str | Path,
    progress: Progress | None = None,
    ready: Callable[[], None] | None = None,
    *,
    form: str | None = None,
    variants: str | Sequence[str] = (),
    settings: Settings = (),
    seed: int | None = None,
    duration: float | None = None,
) -> Run: ...


def simulate(
    scenario: str | Path | Scenario | Mission,
    folder: str | Path | None = None,
    progress: Progress | None = None,
    ready: Callable[[], None] | None = None,
    *,
    form: str | None = None,
    variants: str | Sequence[str] = (),
    settings: Settings = (),
    seed: int | None = None,
    duration: float | None = None,
) -> Flight | Run:
    """Fly a scenario in this process, as fast as possible.

    Parameters
    ----------
    scenario : str, Path, Scenario or Mission
        Name of a bundled scenario, a TOML file or a run's folder, as `load` takes it; or what `load` or `resolve`
        returned, which leaves nothing to choose.
    folder : path, optional
        Where to record the flight, as the processes of a swarm would; empty, or to be created. Default: the flight
        stays in memory.
    progress : callable, optional
        Called with the simulated time, s.
    ready : callable, optional
        Called once when everything is compiled, before the first tick.
    form, variants, settings, seed, duration
        See `load`; ``settings`` may be a mapping: ``{"gains.k11": 3.0}``.

    Returns
    -------
    Flight or Run
        A `Flight` in memory, or the `Run` in ``folder``. Ctrl-C ends a recorded flight early: the run has what was
        flown, and its verdict says so.

    Raises
    ------
    ScenarioError
        If the scenario cannot fly.
    TooLargeError
        If the recording does not fit into memory or on the disk.
    RunError, BusyFolderError
        If ``folder`` holds a run or a study, cannot be written, or another process writes there.
    LawError
        If the law raises an error in flight; nothing is left of it in ``folder``.
    KeyboardInterrupt
        On Ctrl-C in a flight in memory.
    """
    mission = mission_of(scenario, form=form, variants=variants, settings=settings, seed=seed, duration=duration)
    if folder is None:
        flight = fly_in_memory(mission, progress, ready)
        if _ended_early(flight):
            raise KeyboardInterrupt
        return flight
    try:
        with reserved_folder(folder) as path:
            try:
                return fly_to_disk(mission, path, progress, ready)
            except OSError as error:
                raise RunError(
                    f"{path}: cannot be written: {error.strerror or error}; free some space, or give --out"
                ) from None
    except LawError:
        with contextlib.suppress(OSError):
            Path(folder).rmdir()
        raise


def _ended_early(flight: Flight) -> bool:
    timing = flight.mission.timing
    return len(flight.t) < timing.ticks // timing.record_every + 1
