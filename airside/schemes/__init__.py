"""The registry of schemes: every file of this folder, and the entry points of other packages."""

from __future__ import annotations

import functools
import importlib.metadata
import pkgutil
from typing import TYPE_CHECKING

from ftcc.link.cache import SCHEME_ENTRY_POINTS, kept

if TYPE_CHECKING:
    from ftcc.airside.scheme import Scheme

__all__ = ["find", "names", "summary"]


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
    from ftcc.airside.scheme import load

    if name not in _modules():
        raise LookupError(f"there is no scheme {name!r}; there are {', '.join(names())}")
    return load(name, _modules()[name])


def summary(name: str) -> tuple[str, list[str]]:
    """Title and forms of a scheme, for a list; of a file that is no scheme what it lacks, and no forms.

    Those of this folder are imported, which loads numba, only once after an edit.
    """
    title, forms = (_kept_summary if _modules()[name].startswith(f"{__name__}.") else _summary)(name)
    return title, forms


def _summary(name: str) -> tuple[str, list[str]]:
    from ftcc.airside.scheme import SchemeError

    try:
        scheme = find(name)
    except SchemeError as error:
        return str(error), []
    return scheme.title, list(scheme.forms)


_kept_summary = kept(_summary)
