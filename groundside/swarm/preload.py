"""Load and compile what every process of a swarm needs; the fork server imports this once, before it forks.

No sockets, threads, Zenoh or Rerun here. Arrow is loaded, and a first batch written: in each child it would cost 15 MB.
"""

# ruff: noqa: E402 (the garbage collector is off before anything is imported)

from __future__ import annotations

import gc
import os
import signal
from pathlib import Path

# Everything loaded here stays in use. A garbage collection in a child would write to, and so copy, all shared memory
# pages. Without it, loading is also a quarter faster.
gc.disable()

# Ctrl-C while this compiles ends it without a word: the launcher has one.
_heeds_ctrl_c = signal.getsignal(signal.SIGINT) is signal.default_int_handler
if _heeds_ctrl_c:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

# Arrow's allocator would start a thread, which no child would have.
os.environ["JE_ARROW_MALLOC_CONF"] = "background_thread:false"

import numpy as np

from ftcc.airside import process as autopilot_process
from ftcc.airside.autopilots import recorded_signals
from ftcc.airside.compiled_stages import flight_of as flight_of_autopilots
from ftcc.airside.compiled_stages import placeholder as no_autopilot
from ftcc.airside.group import build_group as build_autopilots
from ftcc.groundside.swarm.preloading import ACTIVE_VARIABLE, PLANT_VARIABLE, SCHEME_VARIABLE
from ftcc.link.compiled import is_kept
from ftcc.link.exchange import begin, take_in
from ftcc.link.recording import LINK_COLUMNS, PartWriter, new_rows
from ftcc.link.timing import Timing
from ftcc.sim import process as vehicle_process
from ftcc.sim.group import build_group as build_vehicles
from ftcc.sim.jsbsim.flight import preload as preload_jsbsim
from ftcc.sim.plants import find as find_plant
from ftcc.sim.plants import flies_model
from ftcc.sim.plants import flight_of as flight_of_vehicles
from ftcc.sim.spec import placeholder as no_vehicle

__all__ = ["load"]

_TIMING = Timing(1, 1, 1, 1, 1, 1, 1)


def load(scheme: str, plant: str, active: bool) -> None:
    """Load or compile everything that a swarm of ``scheme`` on ``plant`` executes, ``active``: with diagnosis."""
    compiling = None if is_kept(flight_of_vehicles(plant).fly) else _compile_vehicles(plant)
    _load_autopilots(scheme, active)
    if compiling is not None:
        os.waitpid(compiling, 0)
    _load_vehicles(plant)
    part = PartWriter(Path(os.devnull), LINK_COLUMNS)
    part.write(np.zeros((1, len(LINK_COLUMNS))))
    part.close()


def _load_autopilots(scheme: str, active: bool) -> None:
    spec = no_autopilot(scheme, active)
    columns = autopilot_process.columns(recorded_signals(spec))
    rows, link_rows = (new_rows(1, len(recorded)) for recorded in (columns, LINK_COLUMNS))
    autopilots = build_autopilots([spec], _TIMING, rows, link_rows)
    autopilot_process.load_compiled(autopilots, _TIMING, flight_of_autopilots(scheme, active))
    # Python calls these when it sends and receives; loaded in each child, they would cost 5 MB.
    begin(autopilots.transmission, 0, 0, 0, 1)
    take_in(autopilots.transmission, autopilots.exchange)


def _load_vehicles(plant: str) -> None:
    if flies_model(find_plant(plant)):
        preload_jsbsim()
    vehicles = build_vehicles([no_vehicle(plant)], new_rows(1, len(vehicle_process.columns(plant))), 1)
    vehicle_process.load_compiled(vehicles, _TIMING, flight_of_vehicles(plant))


def _compile_vehicles(plant: str) -> int:
    """Begin to compile what vehicles execute, for the cache; the number of the process that does.

    A first start then takes two cores, and half the time. Where it fails, this process compiles it, and says why.
    """
    if not (child := os.fork()):
        try:
            _load_vehicles(plant)
        finally:
            os._exit(0)
    return child


if SCHEME_VARIABLE in os.environ:
    load(os.environ[SCHEME_VARIABLE], os.environ[PLANT_VARIABLE], os.environ[ACTIVE_VARIABLE] == "1")

if _heeds_ctrl_c:
    signal.signal(signal.SIGINT, signal.default_int_handler)
gc.freeze()
gc.enable()
