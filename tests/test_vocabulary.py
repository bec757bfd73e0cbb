"""Words: the vocabulary names files that exist, and words that it avoids name nothing in the code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
WINGS = ("airside", "groundside", "link", "sim")
PAGE = (ROOT / "docs" / "vocabulary.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in PAGE.splitlines() if line.startswith("| ")]
WORDS = {row[0]: row for row in ROWS if row[0] != "word"}
AVOIDED = PAGE.split("names of modules, functions and classes: ")[1].rstrip(".\n").split(", ")


@pytest.mark.parametrize("word", WORDS)
def test_a_word_has_one_meaning_and_a_place(word: str) -> None:
    cells = WORDS[word]
    assert len(cells) == 3
    assert cells[1].endswith(".")
    place = re.fullmatch(r"`([^`]+)`", cells[2].rstrip("| "))
    assert place is not None
    assert (ROOT / place[1]).exists(), place[1]


def test_no_word_is_explained_twice() -> None:
    assert len(WORDS) == sum(row[0] != "word" for row in ROWS)


def names_of(path: Path) -> Iterator[str]:
    """What a file names: itself, its classes, its functions."""
    yield path.stem
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name


@pytest.mark.parametrize("avoided", AVOIDED)
def test_an_avoided_word_is_no_name(avoided: str) -> None:
    named = [
        f"{path.relative_to(ROOT)}: {name}"
        for wing in WINGS
        for path in sorted((ROOT / wing).rglob("*.py"))
        for name in names_of(path)
        if avoided in re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().split("_")
    ]
    assert named == []
