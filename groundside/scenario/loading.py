"""Scenarios: merging the form, variants and settings of a file, and saying clearly what is wrong with it.

A file holds what all flights share, ``[form.NAME]`` and ``[variant.NAME]`` blocks with what they change, and claims;
variants and claims may stand in files beside it (`catalogue`). A variant may hold ``[variant.NAME.FORM]`` with what it
changes in that form alone. Merged in the order: calibrated thresholds beside the file, file, form, variants as the file
lists them, settings of the command line. Tables are merged, everything else is replaced.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
from ftcc.groundside.scenario.settings import Settings, setting_texts
from ftcc.groundside.scenario.validation import located_error, shortened, validate
from ftcc.groundside.schema import AirframeSheet, Plan, PointMassSheet

__all__ = [
    "Scenario",
    "ScenarioError",
    "airframe_file",
    "forms_and_variants",
    "load",
    "load_airframe",
    "read",
    "scenario_of",
    "shipped",
    "variant_names",
    "with_value",
]

_VARIANT_KEYS = ("title", "forms", "claims_of")


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
    places: Places | None
    """None where it was read from no file."""

    @property
    def case(self) -> str:
        """The key of the claims' expected values."""
        return "+".join((self.form, *self.variants))

    def error(self, problems: Sequence[str]) -> ScenarioError:
        """What is to be raised where these are wrong with it."""
        return located_error(self.file, problems, self.places)


def load(
    name_or_path: str | Path,
    *,
    form: str | None = None,
    variants: str | Sequence[str] = (),
    settings: Settings = (),
    seed: int | None = None,
    duration: float | None = None,
    changes: Mapping[str, Any] | None = None,
) -> Scenario:
    """Read a scenario and choose its form and variants.

    Parameters
    ----------
    name_or_path : str
        A shipped scenario's name, the path of a TOML file, or a run's folder (to fly it again).
    form : str, optional
        Default: the first form of the file.
    variants : sequence of str, or a text with commas between them
    settings : mapping, or sequence of str
        ``{"gains": {"k11": 3.0}}``, ``{"gains.k11": 3.0}`` or ``["gains.k11=3.0"]``, see `settings.setting_texts`;
        a number in the path counts the entries of a list from 0.
    seed, duration
        Override the file's.
    changes : mapping, optional
        What a study changes: merged after the variants, before the settings.

    Raises
    ------
    ScenarioError
    """
    path = find(name_or_path)
    settings = setting_texts(settings, path)
    variants = variant_names(variants)
    contents = contents_of(path)
    document = contents.document
    _require_tables(path, document)
    forms, known_variants = forms_and_variants(document)
    chosen, ordered = _choose(path, document, form, variants)
    layers = [*_calibrated(contents), Layer("base", path, (), document)]
    if "flown" not in document:
        layers += _changes(contents, chosen, forms, ordered)
    if changes:
        layers.append(Layer("changes of the study", None, (), dict(changes)))
    merged: dict[str, Any] = {}
    for layer in layers:
        merged = _merged(merged, layer.content)
    merged = {key: value for key, value in merged.items() if key not in ("form", "variant")}
    merged, options = _with_options(path, merged, settings, seed, duration)
    places = Places(contents, [*layers, *options])
    plan = validate(Plan, merged, path, places)
    if plan.flown is not None:
        flown, settings = plan.flown, (*plan.flown.settings, *settings)
        name, ordered = flown.name, tuple(flown.variants)
    else:
        name = path.stem
        try:
            plan = _with_inherited_claims(plan, merged, path, places, forms, known_variants)
        except ValueError as error:
            raise located_error(path, [str(error)], places) from None
        if problems := _cases_of_none(plan, forms, list(known_variants)):
            raise located_error(path, problems, places)
    return Scenario(
        name, path, chosen, ordered, tuple(settings), plan, merged, document, files=contents.files, places=places
    )


def variant_names(variants: str | Sequence[str]) -> list[str]:
    """Return the names in a sequence, or in a text with commas between them."""
    return [one.strip() for one in variants.split(",") if one.strip()] if isinstance(variants, str) else list(variants)


def scenario_of(
    document: dict[str, Any], file: Path, *, name: str, form: str, variants: Sequence[str] = ()
) -> Scenario:
    """Return the scenario of a merged document; airframes that are files lie beside ``file``, which need not exist.

    Raises
    ------
    ScenarioError
    """
    plan = validate(Plan, document, file)
    return Scenario(name, file, form, tuple(variants), (), plan, document, document, files=(), places=None)


def _choose(
    path: Path, document: dict[str, Any], form: str | None, variants: Sequence[str]
) -> tuple[str, tuple[str, ...]]:
    """The form and the variants to fly, these in the file's order."""
    forms, known = forms_and_variants(document)
    if "flown" in document and (variants or form not in (None, forms[0])):
        raise ScenarioError(
            path,
            [f"is the scenario of a flight in form {forms[0]}: choose forms and variants from the original file"],
        )
    chosen = form or forms[0]
    if chosen not in forms:
        raise ScenarioError(path, [f"form = {chosen!r}: there is no such form; there are {', '.join(forms)}"])
    unknown = [name for name in variants if name not in known]
    if unknown:
        there_are = f"there are {', '.join(known)}" if known else "the file has none"
        raise ScenarioError(path, [f"variant = {', '.join(unknown)}: there is no such variant; {there_are}"])
    return chosen, tuple(name for name in known if name in variants)


def _with_options(
    path: Path, document: dict[str, Any], settings: Sequence[str], seed: int | None, duration: float | None
) -> tuple[dict[str, Any], list[Layer]]:
    """``document`` with what the command line sets, and where each of these values came from."""
    layers = []
    for setting in settings:
        document = _set(path, document, setting)
        layers.append(Layer(f"--set {setting}", None, (), _nested(setting)))
    for option, value in (("seed", seed), ("duration", duration)):
        if value is not None:
            document = document | {option: value}
            layers.append(Layer(f"--{option}", None, (), {option: value}))
    return document, layers


def _with_inherited_claims(
    plan: Plan,
    merged: dict[str, Any],
    path: Path,
    places: Places,
    forms: Sequence[str],
    variants: dict[str, dict[str, Any]],
) -> Plan:
    """``plan`` with the claims of variants that have those of another case (``claims_of``), in ``merged`` too.

    Raises
    ------
    ValueError
        If there is no such case.
    """
    inheriting = {name: block["claims_of"] for name, block in variants.items() if "claims_of" in block}
    if not inheriting:
        return plan
    for name, case in inheriting.items():
        merged["claims"] = _inherited(merged.get("claims", []), name, case, forms, list(variants))
    return validate(Plan, merged, path, places)


def airframe_file(name_or_path: str, scenario_file: Path) -> Path:
    """The file that a scenario means where it names no shipped airframe."""
    return (scenario_file.parent / name_or_path).resolve()


def load_airframe(
    name_or_path: str, scenario_file: Path, places: Places | None = None
) -> AirframeSheet | PointMassSheet:
    """The sheet of a shipped airframe, or of a path relative to the scenario's file."""
    sheets = shipped("airframes")
    path = sheets.get(name_or_path) or airframe_file(name_or_path, scenario_file)
    if not path.is_file():
        there_are = f"there are {', '.join(sheets)}, or give a TOML file"
        raise located_error(
            scenario_file, [f"airframe = {name_or_path!r}: there is no such sheet; {there_are}"], places
        )
    document = read(path)
    if "kd" in document:
        return validate(PointMassSheet, document, path)
    return validate(AirframeSheet, document, path)


def _require_tables(path: Path, document: dict[str, Any]) -> None:
    for key in ("form", "variant"):
        blocks = document.get(key, {})
        if not isinstance(blocks, dict) or not all(isinstance(block, dict) for block in blocks.values()):
            raise ScenarioError(path, [f"{key} = {shortened(blocks)}: must be tables, [{key}.NAME]"])


def _calibrated(contents: Contents) -> Iterator[Layer]:
    """The thresholds that stand beside the scenario, below all else."""
    for file in contents.files:
        if contents.calibrated and file.name.endswith(".diagnosis.toml"):
            yield Layer("calibrated thresholds", file, (), {"diagnosis": contents.calibrated})


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
    try:
        return with_value(document, parts, value)
    except LookupError as error:
        raise ScenarioError(path, [f"--set {setting}: {error.args[0]}"]) from None


def with_value(document: dict[str, Any], parts: Sequence[str], value: Any) -> dict[str, Any]:
    """Return ``document`` with another value at a path of keys, and of numbers in lists.

    Raises
    ------
    LookupError
        If a list has no such entry.
    """

    def changed(node: Any, rest: Sequence[str]) -> Any:
        if not rest:
            return value
        if isinstance(node, list):
            if not rest[0].isdecimal() or int(rest[0]) >= len(node):
                entries = f"{'.'.join(parts)} has {len(node)} entries, counted from 0"
                raise LookupError(f"{entries}; {rest[0]} is none of them")
            index = int(rest[0])
            return [*node[:index], changed(node[index], rest[1:]), *node[index + 1 :]]
        inner = node if isinstance(node, dict) else {}
        return {**inner, rest[0]: changed(inner.get(rest[0]), rest[1:])}

    return changed(document, parts)  # type: ignore[no-any-return]
