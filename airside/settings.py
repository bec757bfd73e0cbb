"""Settings of a stage by name: published values, overridden where a user gives others, each within its range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ftcc.airside.ranges import Range
from ftcc.airside.scheme import quantities

__all__ = ["settings_with"]


def settings_with(record: Any, ranges: Mapping[Range, str], overrides: Mapping[str, float], also: str = "") -> Any:
    """The NamedTuple ``record`` with its fields' published values, and ``overrides``.

    Parameters
    ----------
    record : class whose fields are annotated by `Quantity`.
    ranges : by range, the names of the fields that have it, separated by blanks.
    overrides : values by name.
    also : names that a user may give beside these, for the message.

    Raises
    ------
    ValueError
        For a name that there is not, or a value out of its range.
    """
    known = quantities(record)
    unknown = [name for name in overrides if name not in known]
    if unknown:
        there = ", ".join(filter(None, (also, *known)))
        raise ValueError(f"there is no setting {', '.join(unknown)}; there are {there}")
    for allowed, names in ranges.items():
        for name in names.split():
            if name in overrides and (refusal := allowed.refusal(overrides[name])):
                raise ValueError(f"{name} = {overrides[name]:g}: {refusal}")
    values = {name: note.published for name, note in known.items()} | dict(overrides)
    return record(**{name: float(value) for name, value in values.items() if value is not None})
