"""The site: it is built strictly, shows rather than tells, and its reference is complete."""

from __future__ import annotations

import html
import re
import subprocess
import sys
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from pydantic import BaseModel

from ftcc.airside import schemes
from ftcc.airside.gcs import COMMANDS, MESSAGES
from ftcc.airside.scheme import quantities
from ftcc.groundside.claims.metrics import METRICS
from ftcc.groundside.cli.app import app
from ftcc.groundside.schema import AirframeSheet, Plan, PointMassSheet
from ftcc.link.failures import SIZES
from ftcc.link.mavlink import dialect

pytest.importorskip("mkdocs", reason="MkDocs is not installed (extra docs)")
pytest.importorskip("material", reason="mkdocs-material is not installed (extra docs)")
pytest.importorskip("latex2mathml", reason="latex2mathml is not installed (extra docs)")

ROOT = Path(__file__).parent.parent
BUILD = ROOT / "docs" / "build.py"

BARE = {
    "CHANGELOG.html": "a list of changes",
}
"""Pages without a picture or an example, and why."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site as `docs/build.py` builds it."""
    out = tmp_path_factory.mktemp("site")
    ended = subprocess.run(
        [sys.executable, str(BUILD), "--out", str(out)], capture_output=True, text=True, timeout=200.0, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return out


def article_of(page: Path) -> str:
    """What a page says, without menus."""
    found = re.search(r"<article.*?</article>", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert found is not None, page
    return found[0]


def shown(site: Path, page: str) -> str:
    """The text of a page of the reference."""
    return html.unescape(re.sub(r"</?[a-z][^>]*>", " ", article_of(site / page)))


def test_every_page_has_a_picture_or_an_example(site: Path) -> None:
    bare = {
        str(page.relative_to(site))
        for page in site.rglob("*.html")
        if page.name != "404.html" and not re.search(r"<img |<pre|<math", article_of(page))
    }
    assert bare == set(BARE)


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    fetched = re.compile(
        r"""<(?:script|img|iframe)[^>]*\ssrc="(https?:[^"]*)|<link rel="stylesheet" href="(https?:[^"]*)"""
    )
    found = {
        str(page.relative_to(site)): match
        for page in site.rglob("*.html")
        for match in fetched.findall(page.read_text(encoding="utf-8"))
    }
    assert found == {}


def models_of(model: Any) -> Iterator[type[BaseModel]]:
    """A model and those that its fields hold."""
    if isinstance(model, type) and issubclass(model, BaseModel):
        yield model
        for field in model.model_fields.values():
            yield from models_of(field.annotation)
    elif typing.get_origin(model) in (types.UnionType, typing.Union, list, dict, tuple, typing.Annotated):
        for inner in typing.get_args(model):
            yield from models_of(inner)


@pytest.mark.parametrize(("model", "page"), [((Plan,), "scenario"), ((AirframeSheet, PointMassSheet), "airframe")])
def test_every_field_of_the_schema_is_on_its_page(model: Any, page: str, site: Path) -> None:
    text = article_of(site / "reference" / f"{page}.html")
    models = {one: None for whole in model for one in models_of(whole)}
    fields = [field.alias or name for one in models for name, field in one.model_fields.items()]
    assert len(fields) > 20
    for name in set(fields):
        assert len(re.findall(rf"<td><code>{name}</code></td>", text)) == fields.count(name), name


def test_every_command_is_on_its_page_with_every_option(site: Path) -> None:
    text = shown(site, "reference/commands.html")

    def visit(path: str, command: Any) -> None:
        assert re.search(rf"\s{path}\s", text), path
        for parameter in command.params:
            for option in (*parameter.opts, *parameter.secondary_opts) if parameter.name != "help" else ():
                assert not option.startswith("--") or f" {option}" in text, f"{path} {option}"
        for name, below in getattr(command, "commands", {}).items():
            visit(f"{path} {name}", below)

    visit("ftcc", typer.main.get_command(app))


def test_messages_failures_metrics_gains_are_on_their_pages(site: Path) -> None:
    names = {
        "mavlink": [
            *(dialect.enums["MAV_CMD"][number].name for number in COMMANDS),
            *MESSAGES,
            *(s.name for s in SIZES),
        ],
        "metrics": [*METRICS],
        "gains": [gain for name in schemes.names() for gain in quantities(schemes.find(name).gains_type)],
        "columns": [s.name for name in schemes.names() for s in schemes.find(name).signals],
        "python": ["simulate", "Run", "Flight", "Station", "Swarm", "Study", "Station.fault", "Run.column"],
    }
    for page, wanted in names.items():
        words = set(shown(site, f"reference/{page}.html").split())
        assert [name for name in wanted if name not in words] == [], page


def test_the_program_of_a_tutorial_is_the_file_beside_it() -> None:
    tutorials = ROOT / "docs" / "tutorials"
    page = (tutorials / "faults-from-mavsdk-and-qgroundcontrol.md").read_text(encoding="utf-8")
    program = (tutorials / "mavsdk_fault.py").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    assert program.endswith(block)


def test_what_is_wrong_with_a_page_ends_the_build(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(str(BUILD.parent))
    import build  # type: ignore[import-not-found]
    from mkdocs.exceptions import MkDocsException

    def stage(folder: Path) -> Any:
        staged = build.Stage(folder)
        equations = (
            "$\\nonsense$, $\\left( 1$, $\\begin{odd}a & b\\end{odd}$, $\\begin{aligned}\\alpha & b\\end{aligned}$"
        )
        staged.write("index.md", f"# A\n\n[b](b.md)\n[c](#c)\n![d](d.png)\n\n{equations}\n")
        return staged

    monkeypatch.setattr(build, "stage", stage)
    with pytest.raises(MkDocsException):
        build.build_site(tmp_path / "site")
    said = capsys.readouterr().err
    for fault in ("'b.md'", "'#c'", "'d.png'", "\\\\nonsense", "\\\\left( 1", "{odd}"):
        assert fault in said, said
    assert "\\alpha" not in said
    assert "<mi>&#x003B1;</mi>" in (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
