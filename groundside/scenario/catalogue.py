"""Which scenarios there are, and what their files say: finding and reading them, without what checks or flies them.

A scenario is the file ``NAME.toml``. Where ``NAME.variants.toml``, ``NAME.claims.toml`` or ``NAME.study.toml`` stand
beside it, they are read with it, as if what they hold stood at its end. ``NAME.diagnosis.toml`` holds defaults.

``ftcc list`` shows what this module tells; it is imported in a few milliseconds, where pydantic and numba would take
most of a second.
"""

from __future__ import annotations

import copy
import functools
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario.claim_tables import claims_in
from ftcc.link.cache import kept

__all__ = [
    "Contents",
    "Origin",
    "ScenarioError",
    "Summary",
    "contents_of",
    "find",
    "forms_and_variants",
    "parsed",
    "read",
    "shipped",
    "summary",
    "text_of",
]

_HERE = Path(__file__).parents[1]
_COMPANIONS = {
    "variants": ("variant", "order"),
    "claims": ("claims", "table"),
    "study": ("study",),
    "diagnosis": ("diagnosis",),
}
"""What may stand in ``NAME.variants.toml`` and so on."""


class ScenarioError(UserError):
    """A scenario that cannot fly: every problem with file, field, value and what is allowed.

    ``located`` are the problems with the file and the line of each, where these are known.
    """

    def __init__(self, file: str | Path, problems: Sequence[str], located: Sequence[str] | None = None) -> None:
        self.file = str(file)
        self.problems = tuple(problems)
        super().__init__("\n".join(located or [f"{self.file}: {problem}" for problem in problems]))


class Origin(NamedTuple):
    """Where something stands: a file, and the keys that lead to it there."""

    file: Path
    path: tuple[str, ...]


class Contents(NamedTuple):
    """What the files of a scenario say."""

    document: dict[str, Any]
    """As if all of it stood in one file; claims written out."""
    files: tuple[Path, ...]
    claims: tuple[Origin, ...]
    """Of each claim of ``document``."""
    variants: dict[str, Path]
    calibrated: dict[str, Any]
    """``[diagnosis]`` of the file that `ftcc calibrate` wrote: values for which ``document`` may have others."""


def shipped(kind: str = "scenarios") -> dict[str, Path]:
    """Name and file of the scenarios (or "airframes") that come with the program."""
    return {path.stem: path for path in sorted((_HERE / kind).glob("*.toml")) if not _belongs_to(path)}


def _belongs_to(path: Path) -> Path | None:
    """The scenario whose variants, claims, study or thresholds a file of that name holds."""
    stem, _, kind = path.stem.rpartition(".")
    return path.with_name(f"{stem}.toml") if stem and kind in _COMPANIONS else None


def find(name_or_path: str | Path) -> Path:
    """The file of a shipped scenario, of a path, or of a run's folder."""
    path = Path(name_or_path)
    if str(name_or_path) in shipped():
        return shipped()[str(name_or_path)]
    if path.is_dir() and (path / "scenario.toml").is_file():
        return path / "scenario.toml"
    if (path / "study.toml").is_file():
        raise ScenarioError(path, ["is a study, and no scenario: ftcc simulate STUDY --row N flies one of its flights"])
    if path.is_file():
        if whole := _belongs_to(path):
            raise ScenarioError(path, [f"is a part of {whole.name}, and no scenario by itself: give {whole}"])
        return path
    names = ", ".join(shipped())
    if path.suffix == ".toml" or len(path.parts) > 1:
        raise ScenarioError(path, [f"there is no such file; bundled scenarios are {names}"])
    raise ScenarioError(path, [f"there is no such scenario; there are {names}, or give the path of a TOML file"])


def read(path: Path) -> dict[str, Any]:
    """A scenario as one document, with the variants and claims of the files beside it; a copy, to be changed."""
    return copy.deepcopy(contents_of(path).document)


def contents_of(path: Path) -> Contents:
    """What a scenario's file and those beside it say; parsed once while they stay as they are. Not to be changed."""
    return _contents(_texts(path))


def _texts(path: Path) -> tuple[tuple[Path, str], ...]:
    """The files of a scenario with their texts, its own first."""
    beside = (Path(path).with_suffix(f".{kind}.toml") for kind in _COMPANIONS)
    return tuple((file, text_of(file)) for file in (path, *(file for file in beside if file.is_file())))


@functools.lru_cache(maxsize=16)
def _contents(texts: tuple[tuple[Path, str], ...]) -> Contents:
    (path, text), *beside = texts
    document = parsed(path, text)
    if "flown" in document:  # a run holds all that it flew
        beside = []
    parts = [(path, text, document), *((file, more, parsed(file, more)) for file, more in beside)]
    variants: dict[str, Any] = {}
    variant_files: dict[str, Path] = {}
    claims: list[Any] = []
    origins: list[Origin] = []
    study: dict[str, Any] = {}
    calibrated: dict[str, Any] = {}
    for file, content, part in parts:
        _check_keys(path, file, content, part)
        for name, block in _dict(file, content, part, "variant").items():
            if name in variants:
                there = variant_files[name].name
                raise _refused(file, content, ("variant", name), f"variant.{name}: stands in {there} already")
            variants[name], variant_files[name] = block, file
        for n, claim in enumerate(_list(file, content, part, "claims")):
            claims.append(claim)
            origins.append(Origin(file, ("claims", str(n))))
        for n, table in enumerate(_list(file, content, part, "table")):
            here = ("table", str(n))
            try:
                for within, claim in claims_in(table):
                    claims.append(claim)
                    origins.append(Origin(file, (*here, *within)))
            except ValueError as error:
                place = (*here, *str(error).partition(":")[0].split("."))
                raise _refused(file, content, place, f"table.{n}.{error}") from None
        if order := part.get("order"):
            variants = _ordered(file, content, variants, order)
        if "study" in part and file != path:
            if "study" in document:
                raise _refused(file, content, ("study",), f"study: stands in {path.name} already")
            study = {"study": part["study"]}
        if "diagnosis" in part and file != path:
            calibrated = _gains_alone(file, content, part["diagnosis"])
    document = {key: value for key, value in document.items() if key != "table"} | study
    document |= ({"variant": variants} if variants else {}) | ({"claims": claims} if claims else {})
    return Contents(document, tuple(file for file, _, _ in parts), tuple(origins), variant_files, calibrated)


def _check_keys(path: Path, file: Path, text: str, part: dict[str, Any]) -> None:
    """Refuse what may not stand in a file beside the scenario ``path``, and in itself what only they may hold."""
    if file == path:
        strangers, there = [key for key in part if key == "order"], f"only {path.stem}.variants.toml has one"
    else:
        allowed = _COMPANIONS[file.stem.rpartition(".")[2]]
        strangers = [key for key in part if key not in allowed]
        there = f"only {' and '.join(allowed)} may stand in this file; the rest belongs into {path.name}"
    if strangers:
        raise _refused(file, text, (strangers[0],), f"{', '.join(strangers)}: {there}")


def _gains_alone(file: Path, text: str, table: Any) -> dict[str, Any]:
    """Refuse thresholds that switch something on."""
    if not isinstance(table, dict) or [*table] != ["gains"]:
        raise _refused(file, text, ("diagnosis",), "diagnosis: only [diagnosis.gains] may stand in this file")
    return table


def _dict(file: Path, text: str, part: dict[str, Any], key: str) -> dict[str, Any]:
    value = part.get(key, {})
    if not isinstance(value, dict) or not all(isinstance(block, dict) for block in value.values()):
        raise _refused(file, text, (key,), f"{key} = {value!r:.80}: must be tables, [{key}.NAME]")
    return value


def _list(file: Path, text: str, part: dict[str, Any], key: str) -> list[Any]:
    value = part.get(key, [])
    if not isinstance(value, list):
        raise _refused(file, text, (key,), f"{key} = {value!r:.80}: must be tables, [[{key}]]")
    return value


def _ordered(file: Path, text: str, variants: dict[str, Any], order: Any) -> dict[str, Any]:
    """The variants, those that ``order`` names before all others."""
    if not isinstance(order, list) or not all(isinstance(name, str) and name in variants for name in order):
        raise _refused(file, text, ("order",), f"order = {order!r:.80}: must be names of variants")
    return {name: variants[name] for name in (*order, *variants)}


def _refused(file: Path, text: str, path: tuple[str, ...], problem: str) -> ScenarioError:
    from ftcc.groundside.scenario.places import line_of

    return ScenarioError(file, [problem], [f"{file}:{line_of(text, path) or 1}: {problem}"])


def text_of(path: Path) -> str:
    """The text of a file."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(path, [f"cannot be read: {error}"]) from None


def parsed(path: Path, text: str) -> dict[str, Any]:
    """The contents of a TOML file with this text."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(path, [f"not a TOML file: {error}"]) from None


def forms_and_variants(document: dict[str, Any]) -> tuple[list[str], dict[str, dict[str, Any]]]:
    """Names of the forms, and the variants by name, of a document."""
    flown = document.get("flown")
    if isinstance(flown, dict):
        return [str(flown.get("form", "flight"))], {}
    forms = document.get("form", {})
    variants = document.get("variant", {})
    return list(forms if isinstance(forms, dict) else ()) or ["flight"], variants if isinstance(variants, dict) else {}


class Summary(NamedTuple):
    """What a list shows of a scenario."""

    title: str
    duration: float
    """s; 0 where the file does not say."""
    forms: list[str]
    variants: list[str]


def summary(path: Path) -> Summary:
    """What a list shows of the scenario in a file."""
    return Summary(*_summary([(str(file), text) for file, text in _texts(path)]))


@kept
def _summary(texts: list[tuple[str, str]]) -> tuple[Any, ...]:
    document = _contents(tuple((Path(file), text) for file, text in texts)).document
    forms, variants = forms_and_variants(document)
    return document.get("title", ""), document.get("duration", 0.0), forms, list(variants)
