"""Scenarios: merging the form, variants and settings of a file, and saying clearly what is wrong with it.

A file holds what all flights share, ``[form.NAME]`` and ``[variant.NAME]`` blocks with what they change, and claims;
variants and claims may stand in files beside it (`catalogue`). A variant may hold ``[variant.NAME.FORM]`` with what it
changes in that form alone. Merged in the order: file, form, variants as the file lists them, settings of the command
line. Tables are merged, everything else is replaced.
"""

from __future__ import annotations

import math
import tomllib
import typing
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ftcc.groundside.scenario.catalogue import (
    Contents,
    ScenarioError,
    contents_of,
    find,
    forms_and_variants,
    read,
    shipped,
)
from ftcc.groundside.scenario.places import Layer, Places
from ftcc.groundside.schema import AirframeSheet, Plan, PointMassSheet, fields_of

__all__ = ["Scenario", "ScenarioError", "forms_and_variants", "load", "load_airframe", "read", "shipped"]

_VARIANT_KEYS = ("title", "forms", "claims_of")

M = TypeVar("M", bound=BaseModel)


@dataclass(frozen=True)
class Scenario:
    """A scenario with form and variants chosen, every field checked on its own; `mission.resolve` checks the rest."""

    name: str
    file: Path
    form: str
    variants: tuple[str, ...]
    settings: tuple[str, ...]
    plan: Plan
    document: dict[str, Any]
    """What ``plan`` was made from, as it would stand in a file."""
    source: dict[str, Any]
    """The whole file, with all its forms, variants and claims, and those of the files beside it."""
    files: tuple[Path, ...]
    places: Places

    @property
    def case(self) -> str:
        """The key of the claims' expected values."""
        return "+".join((self.form, *self.variants))

    def error(self, problems: Sequence[str]) -> ScenarioError:
        """What is to be raised where these are wrong with it."""
        return _error(self.file, problems, self.places)


def load(
    name_or_path: str | Path,
    *,
    form: str | None = None,
    variants: Sequence[str] = (),
    settings: Sequence[str] = (),
    seed: int | None = None,
    duration: float | None = None,
) -> Scenario:
    """Read a scenario and choose its form and variants.

    Parameters
    ----------
    name_or_path : str
        A shipped scenario's name, the path of a TOML file, or a run's folder (to fly it again).
    form : str, optional
        Default: the first form of the file.
    variants : sequence of str
    settings : sequence of str
        ``key.path=value``, the value as in TOML; a number in the path counts the entries of a list from 0.
    seed, duration
        Override the file's.

    Raises
    ------
    ScenarioError
    """
    path = find(name_or_path)
    contents = contents_of(path)
    document = contents.document
    _require_tables(path, document)
    known_forms, known_variants = forms_and_variants(document)
    flown = "flown" in document
    if flown and (variants or form not in (None, known_forms[0])):
        raise ScenarioError(
            path,
            [f"is the scenario of a flight in form {known_forms[0]}: choose forms and variants from the original file"],
        )
    chosen = form or known_forms[0]
    if chosen not in known_forms:
        raise ScenarioError(path, [f"form = {chosen!r}: there is no such form; there are {', '.join(known_forms)}"])
    unknown = [name for name in variants if name not in known_variants]
    if unknown:
        there_are = f"there are {', '.join(known_variants)}" if known_variants else "the file has none"
        raise ScenarioError(path, [f"variant = {', '.join(unknown)}: there is no such variant; {there_are}"])
    ordered = tuple(name for name in known_variants if name in variants)
    layers = [Layer("base", path, (), document)]
    if not flown:
        layers += _changes(contents, chosen, known_forms, ordered)
    merged = {key: value for key, value in document.items() if key not in ("form", "variant")}
    for layer in layers[1:]:
        merged = _merged(merged, layer.content)
    for setting in settings:
        merged = _set(path, merged, setting)
        layers.append(Layer(f"--set {setting}", None, (), _nested(setting)))
    for option, value in (("seed", seed), ("duration", duration)):
        if value is not None:
            merged[option] = value
            layers.append(Layer(f"--{option}", None, (), {option: value}))
    places = Places(contents, layers)
    plan = validate(Plan, merged, path, places)
    inheriting = {name: block["claims_of"] for name, block in known_variants.items() if "claims_of" in block}
    if inheriting and plan.flown is None:
        for name, case in inheriting.items():
            try:
                inherited = _inherited(merged.get("claims", []), name, case, known_forms, list(known_variants))
            except ValueError as error:
                raise _error(path, [str(error)], places) from None
            merged["claims"] = inherited
        plan = validate(Plan, merged, path, places)
    name = path.stem
    if plan.flown is not None:
        name, ordered = plan.flown.name, tuple(plan.flown.variants)
        settings = (*plan.flown.settings, *settings)
    else:
        problems = _cases_of_none(plan, known_forms, list(known_variants))
        if problems:
            raise _error(path, problems, places)
    return Scenario(
        name, path, chosen, ordered, tuple(settings), plan, merged, document, files=contents.files, places=places
    )


def _error(file: Path, problems: Sequence[str], places: Places | None) -> ScenarioError:
    return ScenarioError(file, problems, [places.located(one) for one in problems] if places else None)


def load_airframe(
    name_or_path: str, scenario_file: Path, places: Places | None = None
) -> AirframeSheet | PointMassSheet:
    """The sheet of a shipped airframe, or of a path relative to the scenario's file."""
    sheets = shipped("airframes")
    path = sheets.get(name_or_path, scenario_file.parent / name_or_path)
    if not path.is_file():
        there_are = f"there are {', '.join(sheets)}, or give a TOML file"
        raise _error(scenario_file, [f"airframe = {name_or_path!r}: there is no such sheet; {there_are}"], places)
    document = read(path)
    if "kd" in document:
        return validate(PointMassSheet, document, path)
    return validate(AirframeSheet, document, path)


def _require_tables(path: Path, document: dict[str, Any]) -> None:
    for key in ("form", "variant"):
        blocks = document.get(key, {})
        if not isinstance(blocks, dict) or not all(isinstance(block, dict) for block in blocks.values()):
            raise ScenarioError(path, [f"{key} = {_shown(blocks)}: must be tables, [{key}.NAME]"])


def _changes(contents: Contents, form: str, forms: Sequence[str], variants: Sequence[str]) -> Iterator[Layer]:
    """What the form and the variants change, in the order in which they are merged."""
    main, document = contents.files[0], contents.document
    yield Layer(f"form {form}", main, ("form", form), document.get("form", {}).get(form, {}))
    for name in variants:
        block, file, where = document["variant"][name], contents.variants[name], ("variant", name)
        allowed = block.get("forms", forms)
        if form not in allowed:
            raise ScenarioError(main, [f"variant = {name}: flies in form {', '.join(allowed)}, not in {form}"])
        changes = {key: value for key, value in block.items() if key not in (*_VARIANT_KEYS, *forms)}
        yield Layer(f"variant {name}", file, where, changes)
        if form in block:
            yield Layer(f"variant {name} in form {form}", file, (*where, form), block[form])


def _inherited(
    claims: list[dict[str, Any]], variant: str, case: Any, forms: Sequence[str], variants: Sequence[str]
) -> list[dict[str, Any]]:
    """The claims, those of ``case`` also for ``case`` with ``variant`` where they say nothing of it.

    Raises
    ------
    ValueError
    """
    form, *names = str(case).split("+")
    if form not in forms or names != [name for name in variants if name in names] or variant in names:
        raise ValueError(
            f"variant.{variant}.claims_of = {case!r}: must be a form ({', '.join(forms)}), "
            f"followed by other variants of the file, each after a +, in the file's order"
        )
    own = "+".join((form, *(name for name in variants if name in (*names, variant))))
    result = []
    for claim in claims:
        if case in claim["expected"] and own not in claim["expected"]:
            by_case = {
                key: value | {own: value[case]}
                for key, value in claim.items()
                if isinstance(value, dict) and case in value
            }
            claim = claim | by_case
        result.append(claim)
    return result


def _cases_of_none(plan: Plan, forms: Sequence[str], variants: Sequence[str]) -> list[str]:
    """Claims for cases that nobody can ask for: a typing error must not make a claim disappear."""
    problems = []
    for n, claim in enumerate(plan.claims):
        for case in claim.expected:
            form, *names = case.split("+")
            if form not in forms or names != [name for name in variants if name in names]:
                problems.append(
                    f"claims.{n}.expected: case {case!r} ({claim.name}) must be a form ({', '.join(forms)}), "
                    f"followed by variants that the file declares, each after a +, in the file's order"
                )
    return problems


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in changes.items():
        old = result.get(key)
        result[key] = _merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return result


def _key_and_value(setting: str) -> tuple[list[str], Any]:
    """The keys and the value of a ``key.path=value``; what is no TOML is text."""
    key, _, text = setting.partition("=")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    return key.strip().split("."), value


def _nested(setting: str) -> dict[str, Any]:
    """A setting as a table that holds nothing else."""
    parts, node = _key_and_value(setting)
    for part in reversed(parts):
        node = {part: node}
    return node  # type: ignore[no-any-return]


def _set(path: Path, document: dict[str, Any], setting: str) -> dict[str, Any]:
    """``document`` with one ``key.path=value`` applied."""
    parts, value = _key_and_value(setting)
    if "=" not in setting or not all(parts):
        raise ScenarioError(path, [f"--set {setting}: must be key.path=value, such as channel.loss=0.3"])

    def changed(node: Any, rest: list[str]) -> Any:
        if not rest:
            return value
        if isinstance(node, list):
            if not rest[0].isdecimal() or int(rest[0]) >= len(node):
                entries = f"{'.'.join(parts)} has {len(node)} entries, counted from 0"
                raise ScenarioError(path, [f"--set {setting}: {entries}; {rest[0]} is none of them"])
            index = int(rest[0])
            return [*node[:index], changed(node[index], rest[1:]), *node[index + 1 :]]
        inner = node if isinstance(node, dict) else {}
        return {**inner, rest[0]: changed(inner.get(rest[0]), rest[1:])}

    return changed(document, parts)  # type: ignore[no-any-return]


def validate(model: type[M], document: dict[str, Any], file: Path, places: Places | None = None) -> M:
    """``document`` as ``model``, or all that is wrong with it."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        problems = [_problem(model, document, one) for one in error.errors(include_url=False)]
        raise _error(file, list(dict.fromkeys(problems)), places) from None


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
        return f"{where} = {_shown(node)}: there is no such field here; allowed are {', '.join(dict.fromkeys(allowed))}"
    text = error["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    return f"{where} = {_shown(node)}: {text}{_meaning(model, parts)}"


def _shown(value: Any) -> str:
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


def whole(value: float, tolerance: float = 1e-6) -> bool:
    """Whether a positive number is whole but for rounding."""
    return math.isfinite(value) and abs(value - round(value)) <= tolerance * max(1.0, abs(value))
