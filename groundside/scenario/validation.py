"""Check a document against its model, and say what is wrong with it in sentences for the author of the file."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ftcc.groundside.scenario.catalogue import ScenarioError
from ftcc.groundside.scenario.places import Places
from ftcc.groundside.schema import fields_of

__all__ = ["located_error", "shortened", "validate"]

M = TypeVar("M", bound=BaseModel)


def located_error(file: Path, problems: Sequence[str], places: Places | None) -> ScenarioError:
    """The error that names file and line of each problem, as far as they can be found."""
    return ScenarioError(file, problems, [places.located(one) for one in problems] if places else None)


def validate(model: type[M], document: dict[str, Any], file: Path, places: Places | None = None) -> M:
    """``document`` as ``model``, or all that is wrong with it."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        problems = [_problem(model, document, one) for one in error.errors(include_url=False)]
        raise located_error(file, list(dict.fromkeys(problems)), places) from None


def _problem(model: type[BaseModel], document: Any, error: Any) -> str:
    """One finding of pydantic as a sentence for the author of the file."""
    parts: list[str] = []
    node = document
    for part in error["loc"]:
        # Beside keys and indices, pydantic's location names the branches of unions, which stand in no file.
        if isinstance(node, dict) and str(part) in node:
            node = node[str(part)]
        elif isinstance(node, list) and isinstance(part, int) and part < len(node):
            node = node[part]
        elif error["type"] == "missing":
            node = {}
        else:
            continue
        parts.append(str(part))
    where = ".".join(parts) or "the file"
    if error["type"] == "missing":
        return f"{where}: is missing{_meaning(model, parts)}"
    if error["type"] == "extra_forbidden":
        owners = _models_at(model, parts[:-1])
        allowed = [name for owner in owners for name in fields_of(owner)]
        return (
            f"{where} = {shortened(node)}: there is no such field here; allowed are {', '.join(dict.fromkeys(allowed))}"
        )
    text = error["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    return f"{where} = {shortened(node)}: {text}{_meaning(model, parts)}"


def shortened(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _models_in(annotation: Any) -> Iterable[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in typing.get_args(annotation):
        yield from _models_in(inner)


def _models_at(model: type[BaseModel], parts: Sequence[str]) -> list[type[BaseModel]]:
    """The models that describe what stands at a path."""
    current = [model]
    for part in parts:
        found: list[type[BaseModel]] = []
        for one in current:
            for name, field in one.model_fields.items():
                if part in (name, field.alias):
                    found += _models_in(field.annotation)
        current = found or current
    return current


def _meaning(model: type[BaseModel], parts: Sequence[str]) -> str:
    """Unit and meaning of a field, in brackets."""
    for owner in _models_at(model, parts[:-1]) if parts else []:
        for name, field in owner.model_fields.items():
            if parts[-1] in (name, field.alias) and field.description:
                return f" ({field.description})"
    return ""
