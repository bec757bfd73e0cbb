"""Pages: their links lead somewhere, and what they say of files, functions and commands holds."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = ("airside", "deploy", "docs", "groundside", "link", "sim", "tests")
PAGES = sorted([*ROOT.glob("*.md"), *(page for name in FOLDERS for page in (ROOT / name).rglob("*.md"))])


def text_of(page: Path) -> str:
    """Of a page, without its blocks of code."""
    return re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def anchors_of(page: Path) -> set[str]:
    """Of a page's headings, as GitHub makes them."""
    titles = re.findall(r"^#+ (.+)$", text_of(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)\s]+)\)|^\[[^\]]+\]: (\S+)", text_of(page), flags=re.MULTILINE)
    astray = []
    for link in (inline or below for inline, below in links):
        if link.startswith("http"):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if not target.exists() or (anchor and anchor not in anchors_of(target)):
            astray.append(link)
    assert astray == []


@pytest.mark.parametrize(
    "page", ["README.md", "CONTRIBUTING.md", *(f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md"))]
)
def test_files_that_are_named_exist(page: str) -> None:
    """Paths in backticks that begin with a folder of the repository."""
    named = re.findall(rf"`((?:{'|'.join(FOLDERS)}|\.ci|\.github)/[\w./-]*)`", text_of(ROOT / page))
    assert [name for name in named if not (ROOT / name).exists()] == []


def functions_of(path: Path) -> set[str]:
    return {n.name for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.FunctionDef)}


def test_the_way_of_a_fault_is_that_of_the_code() -> None:
    """Every step of the walk from the keyboard to the elevator is a function of its file."""
    _, section = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").split("## One parameter")
    steps = re.findall(r"^\| (\d+) \| `([^`]+)` \| `([^`]+)` \|", section, flags=re.MULTILINE)
    assert [int(n) for n, _, _ in steps] == list(range(1, len(steps) + 1))
    assert len(steps) > 15
    assert [(file, name) for _, file, name in steps if name not in functions_of(ROOT / file)] == []


def test_templates_are_filled_in_where_the_page_says() -> None:
    page = (ROOT / "docs" / "compiled.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w/.]+)` \| ([^|]+) \| `(\w+)` in `([^`]+)` \|", page, flags=re.MULTILINE)
    assert len(rows) == 5
    for template, free, function, file in rows:
        assert function in functions_of(ROOT / file)
        source = (ROOT / template).read_text(encoding="utf-8")
        for name in re.findall(r"`(\w+)`", free):
            assert f'globals()["{name}"]' in source, (template, name)


def test_ci_calls_what_a_contributor_can_call() -> None:
    called = set(
        re.findall(r'^"\$work/venv/bin/(?!pip)(.+)"?$', (ROOT / ".ci" / "run").read_text(), flags=re.MULTILINE)
    )
    called = {line.replace('"', "", 1) for line in called}
    contributing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    typed = {line.removeprefix(".venv/bin/") for line in contributing.splitlines() if line.startswith(".venv/bin/")}
    assert {line.removesuffix(" --durations=15") for line in called} == {t for t in typed if not t.startswith("pip")}


def test_the_version_stands_once() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert "\nversion:" not in (ROOT / "CITATION.cff").read_text(encoding="utf-8"), "it would have to be kept equal"
