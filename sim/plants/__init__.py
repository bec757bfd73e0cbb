"""The plants: every file of this folder is a set of equations of motion, see ``sim/README.md``."""

from __future__ import annotations

import functools
import importlib
import pkgutil
from types import ModuleType

from ftcc.link.actuators import SLOT, unit_of
from ftcc.link.compiled import instantiate

__all__ = ["conditions_of", "cycle_of", "find", "flies_model", "flight_of", "name_of", "names"]

_REQUIRED = ("State", "Inputs", "Disturbances", "Parameters")
_LISTS = ("ACTUATORS", "COMPLETED", "DISTURBANCES", "SERVES", "START")
_FUNCTIONS = ("rates", "airspeed", "truth", "complete", "lost", "initial", "level")


def names() -> list[str]:
    """Names of all plants."""
    return sorted(info.name for info in pkgutil.iter_modules(__path__))


def name_of(plant: ModuleType) -> str:
    """Name of a plant's module."""
    return plant.__name__.removeprefix(f"{__name__}.")


@functools.cache
def find(name: str) -> ModuleType:
    """The module of this plant, checked for completeness.

    Raises
    ------
    LookupError
        With the names that exist.
    TypeError
        If the file lacks something.
    """
    if name not in names():
        raise LookupError(f"there is no plant {name!r}; there are {', '.join(names())}")
    module = importlib.import_module(f"{__name__}.{name}")
    missing = [wanted for wanted in _REQUIRED + _LISTS + _FUNCTIONS if not hasattr(module, wanted)]
    if missing:
        raise TypeError(f"plant {name} ({module.__name__}) lacks {', '.join(missing)}")
    unknown = [actuator for actuator in module.ACTUATORS if actuator not in SLOT]
    if unknown:
        raise TypeError(f"plant {name}: actuators {', '.join(unknown)} have no slot in ftcc.link.actuators")
    return module


def flies_model(plant: ModuleType) -> bool:
    """Whether an external model flies the plant's vehicles, see ``driven`` in ``sim/README.md``."""
    return hasattr(plant, "driven")


def conditions_of(plant: str) -> tuple[tuple[str, str], ...]:
    """Names and units of a vehicle's true faults and disturbances: effectiveness, bias, disturbances."""
    module = find(plant)
    return (
        *((f"{name}_effectiveness", "-") for name in module.ACTUATORS),
        *((f"{name}_bias", unit_of(name)) for name in module.ACTUATORS),
        *module.DISTURBANCES,
    )


def cycle_of(plant: str) -> ModuleType:
    """The compiled flight of vehicles of that plant, see `cycle`."""
    return instantiate("ftcc.sim.cycle", plant, plant=find(plant))


def flight_of(plant: str) -> ModuleType:
    """The compiled flight of a process of vehicles of that plant, see `flight`."""
    return instantiate("ftcc.sim.flight", plant, cycle=cycle_of(plant))
