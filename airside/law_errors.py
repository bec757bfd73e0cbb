"""What a control law did wrong in flight, as a sentence with file and line, UAV and time."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.autopilots import Autopilots
from ftcc.airside.law_checks import place_of, shown_path
from ftcc.airside.scheme import LARGEST_COMMAND, LARGEST_STATE, Scheme
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.compiled import is_left_out, layout

__all__ = ["NOT_FINITE", "describe_error", "describe_left_out", "describe_not_finite", "package_of"]

_PYTHONS = (TypeError, AttributeError, NameError, IndexError, KeyError, ValueError, ZeroDivisionError, OverflowError)
"""Errors whose text says what is wrong without the name of their class."""


NOT_FINITE = "step gave no finite number"
"""In the text of an event: what `describe_not_finite` says."""


def package_of(module: ModuleType) -> list[ModuleType]:
    """A scheme's module, and, if it comes from another package than this one, what else of that is loaded."""
    package, own = module.__name__.split(".")[0], __name__.split(".")[0]
    if package == own:
        return [module]
    return [one for name, one in list(sys.modules.items()) if name == package or name.startswith(f"{package}.")]


def describe_error(error: BaseException, scheme: Scheme, autopilots: Autopilots, specs: Sequence[AutopilotSpec]) -> str:
    """Where and at whose step a law raised ``error``; empty if it was not the law.

    Compiled code leaves its file and line in the traceback, too.
    """
    files = {getattr(module, "__file__", None) for module in package_of(scheme.module)}
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in files]
    if not frames:
        return ""
    at, i = frames[-1], int(autopilots.stepping[0])
    text = str(error) if isinstance(error, _PYTHONS) and str(error) else f"{type(error).__name__}: {error}".rstrip(": ")
    place = f"{shown_path(at.filename)}:{at.lineno}"
    return f"{place}: in {at.name}: {text} (UAV {specs[i].uav}, t = {autopilots.own[i, 0]:g} s)"


def describe_not_finite(scheme: Scheme, autopilots: Autopilots, i: int) -> str:
    """Which commands, states and shared values of autopilot ``i``, whose law has just diverged, are not finite."""
    module = scheme.module
    shared = [quantity.name for quantity in scheme.shared.get("follower", ())]
    found = [
        *_strange("command", _entries(module.Output)[: len(scheme.commands)], autopilots.output[i], LARGEST_COMMAND),
        *_strange("state", _entries(module.State), autopilots.state[i], LARGEST_STATE),
        *_strange("shared", shared, autopilots.shared[i], LARGEST_COMMAND),
    ]
    return f"{place_of(module.step)}: {NOT_FINITE}: {', '.join(found) or 'command'}"


def _strange(kind: str, names: Sequence[str], values: NDArray[np.float64], largest: float) -> list[str]:
    """Of some numbers those that are not finite, or beyond what fits a command, each with its value."""
    pairs = [(name, value) for name, value in zip(names, values.tolist()) if not abs(value) < largest]
    return [f"{kind} {name} = {value:.3g}" for name, value in pairs]


def _entries(record: type) -> list[str]:
    """A name for each number of a NamedTuple class as a vector: ``z``, ``e[1]``."""
    names = []
    for name, (at, end, _) in zip(record._fields, layout(record)):  # type: ignore[attr-defined]
        names += [name] if end - at == 1 else [f"{name}[{n}]" for n in range(end - at)]
    return names


def describe_left_out(module: ModuleType) -> str:
    """Which functions of a scheme lack ``@compiled``, and where; empty where all have it, or nothing is compiled."""
    functions = ("start", "step", "share", "observe")
    lacking = [name for name in functions if hasattr(module, name) and is_left_out(getattr(module, name))]
    if not lacking:
        return ""
    above = "each" if len(lacking) > 1 else "it"
    place = place_of(getattr(module, lacking[0]))
    return f"{place}: {_listed(lacking)} without @compiled; put it (from ftcc.link.compiled) above {above}"


def _listed(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"{names[0]} is"
    return f"{', '.join(names[:-1])} and {names[-1]} are"
