"""The pages of the schemes: one for each, of claims and functions that exist, up to date with the scenarios' files."""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ftcc.airside import schemes
from ftcc.groundside.report.definitions import read_sheet
from ftcc.groundside.scenario.loading import load, read, shipped
from ftcc.groundside.scenario.mission import resolve

ROOT = Path(__file__).parent.parent
PAGES = ROOT / "docs" / "schemes"


def loaded() -> ModuleType:
    """The script that writes the pages; ``docs`` is no package."""
    spec = importlib.util.spec_from_file_location("scheme_pages", ROOT / "docs" / "scheme_pages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


SCRIPT = loaded()
CHAPTERS = SCRIPT.CHAPTERS
of_every_chapter = pytest.mark.parametrize("chapter", CHAPTERS, ids=lambda chapter: chapter.scheme)


def page_of(scheme: str) -> str:
    return (PAGES / f"{scheme}.md").read_text(encoding="utf-8")


def rows_between(page: str, marker: str) -> list[list[str]]:
    """The cells of a table between its markers, without its heads."""
    _, _, rest = page.partition(f"<!-- begin {marker} -->")
    part, end, _ = rest.partition(f"<!-- end {marker} -->")
    assert end
    rows = [line for line in part.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in rows[2:]]


def test_every_scheme_has_its_page() -> None:
    names = sorted(schemes.names())
    assert sorted(chapter.scheme for chapter in CHAPTERS) == names
    assert sorted(page.stem for page in PAGES.glob("*.md")) == sorted(["README", *names])


@of_every_chapter
def test_the_claims_of_a_page_are_those_of_the_scenario(chapter: Any) -> None:
    scheme = chapter.scheme
    expected = []
    for form in SCRIPT.FORMS:
        mission = resolve(load(scheme, form=form))
        for claim in SCRIPT.chosen(mission.claims, mission.case):
            named = SCRIPT.claim_cells(form, claim, mission.case)
            expected.append([SCRIPT.escaped(cell) for cell in named])
    shown = rows_between(page_of(scheme), "claims")
    assert [[*row[:3], row[4]] for row in shown] == expected
    assert {row[5] for row in shown} <= {"yes", "**no**", "not flown"}


@of_every_chapter
def test_the_readings_of_a_page_are_those_of_the_sheet(chapter: Any) -> None:
    scheme = chapter.scheme
    sheet = read_sheet(ROOT / "groundside" / "report" / "figures" / f"{scheme}.toml")
    expected = []
    for figure in sheet.figures:
        for reading in figure.readings:
            what = f"{reading.what}, {reading.unit}" if reading.unit else reading.what
            expected.append([figure.number or "-", SCRIPT.escaped(what)])
    assert [row[:2] for row in rows_between(page_of(scheme), "figures")] == expected


@of_every_chapter
def test_the_limits_of_a_page_are_variants_that_fly(chapter: Any) -> None:
    scheme = chapter.scheme
    variants = read(shipped()[scheme])["variant"]
    shown = rows_between(page_of(scheme), "limits")
    assert [row[0] for row in shown] == [f"`{form}`, `{names}`" for form, names in chapter.limits]
    for form, names in chapter.limits:
        assert all(form in variants[name].get("forms", SCRIPT.FORMS) for name in names.split("+"))


@of_every_chapter
def test_a_page_states_the_assumption_on_the_graph(chapter: Any) -> None:
    page = " ".join(page_of(chapter.scheme).split())
    assert f"**Assumption:** {schemes.find(chapter.scheme).graph.value}" in page


@of_every_chapter
def test_functions_that_a_page_names_are_in_their_files(chapter: Any) -> None:
    rows = re.findall(r"^\| [^|]+ \| ([^|]+) \| `([\w/]+\.py)` \|$", page_of(chapter.scheme), flags=re.MULTILINE)
    assert len(rows) > 4
    for names, file in rows:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        there = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert set(re.findall(r"`(\w+)`", names)) <= there, file


@of_every_chapter
def test_variants_and_pictures_that_a_page_names_exist(chapter: Any) -> None:
    page = page_of(chapter.scheme)
    variants = read(shipped()[chapter.scheme])["variant"]
    named = [
        name
        for several in re.findall(r"variants? ((?:`\w+`(?:, | and )?)+)", page)
        for name in re.findall(r"`(\w+)`", several)
    ]
    assert [name for name in named if name not in variants] == []
    pictures = {f"../pictures/schemes/{SCRIPT.picture_name(chapter, *picture)}" for picture in chapter.pictures}
    assert set(re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page)) == pictures


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.md")), ids=lambda page: page.stem)
def test_mathematics_stands_where_every_renderer_finds_it(page: Path) -> None:
    """Displays between lines of two dollars; within a line, pairs of single ones, with no bar in a table."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    parts = re.split(r"^\$\$$", text, flags=re.MULTILINE)
    assert len(parts) % 2 == 1
    for display in parts[1::2]:
        assert "$" not in display
        assert display.count("{") == display.count("}")
        assert display.count("\\begin{") == display.count("\\end{")
        assert len(re.findall(r"\\left\b", display)) == len(re.findall(r"\\right\b", display))
    for line in "".join(parts[0::2]).splitlines():
        assert line.count("$") % 2 == 0, line


def test_the_index_says_what_the_schemes_say() -> None:
    index = page_of("README")
    assert SCRIPT.index_table() in index
