"""Imported once by the fork server: what every process of a swarm needs, compiled or loaded, before it is forked.

No socket, no thread, no Zenoh, Rerun or pyarrow here.
"""

from __future__ import annotations

import math
import os

from ftcc.airside import process as autopilot_process
from ftcc.airside.autopilots import build as build_autopilots
from ftcc.airside.autopilots import placeholder, tick_of
from ftcc.airside.link_events import link_events
from ftcc.link.actuators import ACTUATORS
from ftcc.link.timing import Timing
from ftcc.sim import process as vehicle_process
from ftcc.sim.plant import TRUTH, Guards
from ftcc.sim.plants import cycle_of
from ftcc.sim.plants import find as find_plant
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.spec import build as build_vehicles

__all__ = ["PLANT_VARIABLE", "SCHEME_VARIABLE", "load"]

SCHEME_VARIABLE = "FTCC_PRELOAD_SCHEME"
"""Environment variable that names the scheme to load."""

PLANT_VARIABLE = "FTCC_PRELOAD_PLANT"
"""Environment variable that names the plant to load."""


def load(scheme: str, plant: str) -> None:
    """Load, or compile, everything that a swarm of ``scheme`` on ``plant`` runs."""
    flown = find_plant(plant)
    nothing = placeholder(scheme)
    autopilots, inbox = build_autopilots([nothing], Timing(1, 1, 1, 1, 1, 1, 1))
    autopilot_process.load_compiled(autopilots, inbox, link_events([nothing]), tick_of(scheme))
    vehicle_process.load_compiled(
        build_vehicles(
            [
                VehicleSpec(
                    uav=1,
                    kind="aircraft",
                    plant=plant,
                    airframe=(1.0,) * len(flown.Parameters._fields),
                    initial=(1.0,) * len(flown.State._fields),
                    command=(0.0,) * len(ACTUATORS),
                    limits=((0.0, 0.0),) * len(ACTUATORS),
                    lag=(0.0,) * len(ACTUATORS),
                    rate=(math.inf,) * len(ACTUATORS),
                    fault_before_lag=False,
                    faults=(),
                    disturbances=(),
                    noise=(0.0,) * len(TRUTH),
                    guards=Guards(*(0.0,) * len(Guards._fields)),
                    offset=0.0,
                )
            ]
        ),
        cycle_of(plant),
    )


if SCHEME_VARIABLE in os.environ:
    load(os.environ[SCHEME_VARIABLE], os.environ[PLANT_VARIABLE])
