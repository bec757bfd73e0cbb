"""What people touch.

`Run` opens a recorded flight; `load` and `resolve` prepare one for `simulate.simulate`; `Station` commands a running
swarm.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ftcc.groundside.conversation import StationError
    from ftcc.groundside.mission import Mission, resolve
    from ftcc.groundside.run import Run, RunError
    from ftcc.groundside.scenario import Scenario, ScenarioError, load
    from ftcc.groundside.station import Station

__all__ = ["Mission", "Run", "RunError", "Scenario", "ScenarioError", "Station", "StationError", "load", "resolve"]

_HOMES = {
    "Mission": "mission",
    "resolve": "mission",
    "Run": "run",
    "RunError": "run",
    "Scenario": "scenario",
    "ScenarioError": "scenario",
    "Station": "station",
    "StationError": "conversation",
    "load": "scenario",
}


def __getattr__(name: str) -> Any:
    """Import on first use: a child process or ``ftcc list`` must not pay for pydantic and Arrow."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
