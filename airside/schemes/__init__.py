"""The registry of schemes: every file of this folder, and the entry points of other packages."""

from __future__ import annotations

import functools
import importlib.metadata
import pkgutil

from ftcc.airside.scheme import Scheme, load
from ftcc.link.compiled import SCHEME_ENTRY_POINTS

__all__ = ["find", "names"]


@functools.cache
def _modules() -> dict[str, str]:
    own = {info.name: f"{__name__}.{info.name}" for info in pkgutil.iter_modules(__path__)}
    others = {e.name: e.value for e in importlib.metadata.entry_points(group=SCHEME_ENTRY_POINTS)}
    return own | others


def names() -> list[str]:
    """Names of all schemes."""
    return sorted(_modules())


@functools.cache
def find(name: str) -> Scheme:
    """The scheme of that name.

    Raises
    ------
    LookupError
        With the names that exist.
    SchemeError
        With what its file lacks.
    """
    if name not in _modules():
        raise LookupError(f"there is no scheme {name!r}; there are {', '.join(names())}")
    return load(name, _modules()[name])
