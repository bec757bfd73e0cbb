"""Which scenarios there are, and what their files say: finding and reading them, without what checks or flies them.

``ftcc list`` shows what this module tells; it is imported in a few milliseconds, where pydantic and numba would take
most of a second.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ftcc.groundside.errors import UserError
from ftcc.link.cache import kept

__all__ = ["ScenarioError", "Summary", "find", "forms_and_variants", "parsed", "read", "shipped", "summary", "text_of"]

_HERE = Path(__file__).parents[1]


class ScenarioError(UserError):
    """A scenario that cannot fly: every problem with file, field, value and what is allowed."""

    def __init__(self, file: str | Path, problems: Sequence[str]) -> None:
        self.file = str(file)
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{self.file}: {problem}" for problem in problems))


def shipped(kind: str = "scenarios") -> dict[str, Path]:
    """Name and file of the scenarios (or "airframes") that come with the program."""
    return {path.stem: path for path in sorted((_HERE / kind).glob("*.toml"))}


def find(name_or_path: str | Path) -> Path:
    """The file of a shipped scenario, of a path, or of a run's folder."""
    path = Path(name_or_path)
    if str(name_or_path) in shipped():
        return shipped()[str(name_or_path)]
    if path.is_dir() and (path / "scenario.toml").is_file():
        return path / "scenario.toml"
    if path.is_file():
        return path
    names = ", ".join(shipped())
    if path.suffix == ".toml" or len(path.parts) > 1:
        raise ScenarioError(path, [f"there is no such file; shipped scenarios are {names}"])
    raise ScenarioError(path, [f"there is no such scenario; there are {names}, or give the path of a TOML file"])


def read(path: Path) -> dict[str, Any]:
    """The contents of a TOML file."""
    return parsed(path, text_of(path))


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
    return Summary(*_summary(str(path), text_of(path)))


@kept
def _summary(path: str, text: str) -> tuple[Any, ...]:
    document = parsed(Path(path), text)
    forms, variants = forms_and_variants(document)
    return document.get("title", ""), document.get("duration", 0.0), forms, list(variants)
