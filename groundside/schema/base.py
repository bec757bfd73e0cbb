"""Types that all tables of a scenario use."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, create_model

__all__ = ["Actuator", "Id", "NotNegative", "Positive", "Probability", "Strict", "check_end", "extended"]

Id = Annotated[int, Field(ge=1, le=200)]
"""MAVLink system id of a UAV."""
Actuator = Literal["thrust", "elevator", "aileron", "rudder", "load_factor", "bank"]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Positive = Annotated[float, Field(gt=0.0)]


class Strict(BaseModel):
    """A table that refuses unknown fields, nan and inf."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Table = TypeVar("Table", bound=Strict)


def extended(fields: Mapping[str, Any]) -> Callable[[type[Table]], type[Table]]:
    """Return a class decorator that adds ``fields`` (name: (type, `Field`)) after a table's own fields."""

    def extend(table: type[Table]) -> type[Table]:
        described: dict[str, Any] = {"__base__": table, "__module__": table.__module__, "__doc__": table.__doc__}
        return create_model(table.__name__, **described, **fields)  # type: ignore[no-any-return]

    return extend


def check_end(at: float, until: float | None) -> None:
    """Raise ValueError for an event that does not end after its beginning (times in s)."""
    if until is not None and until <= at:
        raise ValueError(f"until = {until:g} must be later than at = {at:g}")
