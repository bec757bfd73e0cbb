"""The scenario as flown: one file that is enough to repeat the flight."""

from __future__ import annotations

import functools
import importlib.metadata
import platform

import tomli_w

from ftcc.airside.scheme import Scheme
from ftcc.groundside.scenario.laws import mission_values_for_gains
from ftcc.groundside.scenario.loading import Scenario, airframe_file

__all__ = ["as_flown"]

_VERSIONED = ("ftcc-sitl", "numpy", "numba", "scipy", "pydantic", "pymavlink", "eclipse-zenoh")
"""Packages on whose version the numbers of a flight may depend."""


@functools.cache
def _versions(jsbsim: bool) -> dict[str, str]:
    names = [*_VERSIONED, *(["jsbsim"] if jsbsim else [])]
    return {name: importlib.metadata.version(name) for name in names} | {"python": platform.python_version()}


def _all_gains(scenario: Scenario, scheme: Scheme) -> dict[str, float]:
    gains = scheme.gains(scenario.form, scenario.plan.gains.common, mission_values_for_gains(scenario.plan))
    return gains._asdict()  # type: ignore[no-any-return]


def as_flown(scenario: Scenario, scheme: Scheme) -> str:
    """Return the merged scenario with seed, versions and the value of every gain, as TOML.

    A default that changes in a later version does not change this flight. Files of the user's own stay where they are,
    and are named by their full path.
    """
    document = {key: value for key, value in scenario.document.items() if key not in ("flown", "study")}
    document["seed"] = scenario.plan.seed
    if (sheet := airframe_file(scenario.plan.airframe, scenario.file)).is_file():
        document["airframe"] = str(sheet)
    model = scenario.plan.plant.aircraft
    if model is not None and model.endswith(".xml"):
        document["plant"] = document["plant"] | {"aircraft": str((scenario.file.parent / model).resolve())}
    gains = document.get("gains", {})
    document["gains"] = gains | _all_gains(scenario, scheme)
    document["flown"] = {
        "name": scenario.name,
        "form": scenario.form,
        "variants": list(scenario.variants),
        "settings": list(scenario.settings),
        "versions": _versions(scenario.plan.plant.aircraft is not None),
    }
    return tomli_w.dumps(document)
