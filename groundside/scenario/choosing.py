"""From what a script names to the mission that it flies."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from ftcc.groundside.scenario.loading import Scenario, load
from ftcc.groundside.scenario.mission import Mission, resolve

__all__ = ["ScenarioWarning", "mission_of"]


class ScenarioWarning(UserWarning):
    """What `resolve` remarks about a scenario that can fly."""


def mission_of(scenario: str | Path | Scenario | Mission, **options: Any) -> Mission:
    """Return the mission to fly; warn of what a scenario that is resolved here remarks.

    Parameters
    ----------
    scenario : name, path, Scenario or Mission
    options : see `load`; only for a name or a path.

    Raises
    ------
    ScenarioError
        If the scenario cannot fly.
    TypeError
        If there are options for what is loaded already.
    """
    if isinstance(scenario, Mission | Scenario):
        if given := [name for name, value in options.items() if value not in (None, (), [], {}, "")]:
            raise TypeError(f"{', '.join(given)}: give it to load, whose result is flown here")
        if isinstance(scenario, Mission):
            return scenario
        mission = resolve(scenario)
    else:
        mission = resolve(load(scenario, **options))
    for text in mission.warnings:
        warnings.warn(f"{mission.name}: {text}", ScenarioWarning, stacklevel=3)
    return mission
