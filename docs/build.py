"""Builds the site: ``python docs/build.py [--out site] [--pictures]``. Needs the extra ``docs``.

The pages stay where they are read on GitHub. They are copied with their pictures into a temporary folder; what they
link to besides, source and data, becomes pages too. The build is strict: a broken link, a missing anchor, picture or
page, an equation that cannot be set ends it with exit code 1.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import logging
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from mkdocs.commands.build import build
from mkdocs.config import load_config
from mkdocs.exceptions import MkDocsException
from reference_pages import PAGES

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("airside", "deploy", "docs", "groundside", "link", "sim", "tests")
MOVED = {"docs/welcome.md": "index.md", "README.md": "start.md"}
"""Pages that stand elsewhere on the site: it begins with the gallery."""
PICTURES = {".png", ".svg", ".gif"}
LANGUAGES = {".py": "python", ".pyi": "python", ".toml": "toml", ".yaml": "yaml", ".cff": "yaml", ".json": "json"}
SCRIPTS = ("pictures.py", "scheme_pages.py", "rooms.py")
"""Which draw pictures within minutes."""
LONG_SCRIPTS = ("active_studies.py", "closures.py", "diagnosis_figures.py", "attack_studies.py", "attacked_swarms.py")
"""Measure for far longer: called by hand."""

_FENCE = re.compile(r"(^```.*?^```|`[^`\n]+`)", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"(\]\(|^\[[^\]]+\]: )([^)\s#]+)(#[^)\s]*)?", re.MULTILINE)


class Stage:
    """The folder from which the site is built."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.sources: set[str] = set()
        """Pages made of files and folders that are linked to: they are in no menu."""

    def write(self, name: str, text: str) -> None:
        """A page."""
        page = self.folder / name
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(text, encoding="utf-8")

    def page(self, path: Path) -> None:
        """A page of the repository, with its links and pictures."""
        name = path.relative_to(ROOT).as_posix()
        place = MOVED.get(name, name)
        pieces = _FENCE.split(path.read_text(encoding="utf-8"))
        for n in range(0, len(pieces), 2):  # every second piece is code
            pieces[n] = _LINK.sub(lambda found: self._link(found, path, place), pieces[n])
        self.write(place, "".join(pieces) + offered(path.parent))

    def _link(self, found: re.Match[str], page: Path, place: str) -> str:
        """A link of a page, as it is on the site. What leads nowhere stays, for MkDocs to find."""
        opening, link, anchor = found[1], found[2], found[3] or ""
        target = (page.parent / link).resolve()
        if "://" in link or link.startswith("mailto:") or not target.is_relative_to(ROOT) or not target.exists():
            return found[0]
        name = self._page_of(target)
        return f"{opening}{os.path.relpath(name, Path(place).parent)}{anchor}"

    def _page_of(self, target: Path) -> str:
        """What shows a file or a folder of the repository on the site."""
        if target.is_dir() and (target / "README.md").exists():
            target = target / "README.md"
        name = target.relative_to(ROOT).as_posix()
        if target.suffix == ".md":
            return MOVED.get(name, name)
        if target.suffix in PICTURES:
            self.folder.joinpath(name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(target, self.folder / name)
            return name
        page = f"{name}.md"
        if page not in self.sources:
            self.sources.add(page)
            self.write(page, source_page(target, name))
        return page


def offered(room: Path) -> str:
    """What `groundside` or a room of it offers, for the end of its page; empty for other folders."""
    stub = room / "__init__.pyi" if (room / "__init__.pyi").exists() else room / "__init__.py"
    if "groundside" not in (room.name, room.parent.name) or not stub.exists():
        return ""
    return f"\n\n## What the others use of it\n\n{fenced(stub)}"


def source_page(path: Path, name: str) -> str:
    """A file, or the files of a folder, as a page."""
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.is_file())
        return f"# {name}/\n\n" + "\n\n".join(f"## {file.name}\n\n{fenced(file)}" for file in files)
    return f"# {name}\n\n{notebook(path) if path.suffix == '.ipynb' else fenced(path)}"


def fenced(path: Path) -> str:
    """A file as a block of code."""
    return f"````{LANGUAGES.get(path.suffix, 'text')}\n{path.read_text(encoding='utf-8').rstrip()}\n````\n"


def notebook(path: Path) -> str:
    """The cells of a notebook, with headings one level lower."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    texts = [(cell["cell_type"], "".join(cell["source"])) for cell in cells]
    return "\n\n".join(
        f"```python\n{text}\n```" if kind == "code" else re.sub(r"^#", "##", text, flags=re.MULTILINE)
        for kind, text in texts
    )


def filled_in(nav: list[Any], pages: list[str]) -> list[Any]:
    """``nav`` with the pages that its patterns stand for. A menu without pages is left out."""
    named = {item for item in leaves(nav) if "*" not in item}

    def fill(item: Any) -> list[Any]:
        if isinstance(item, dict):
            ((title, inner),) = item.items()
            if isinstance(inner, str) and "*" not in inner:
                return [item]
            below = [one for entry in ([inner] if isinstance(inner, str) else inner) for one in fill(entry)]
            return [{title: below}] if below else []
        if "*" not in item:
            return [item]
        meant = [page for page in pages if page not in named and matches(page, item)]
        named.update(meant)
        return meant

    return [one for item in nav for one in fill(item)]


def leaves(item: Any) -> list[str]:
    """The pages and patterns of a menu."""
    if isinstance(item, str):
        return [item]
    return [leaf for inner in (item.values() if isinstance(item, dict) else item) for leaf in leaves(inner)]


def matches(page: str, pattern: str) -> bool:
    """Whether a pattern stands for a page: ``*`` for a part of a path, ``**`` for any."""
    if pattern.startswith("**/"):
        return fnmatch.fnmatch(page, pattern[3:])
    parts, names = pattern.split("/"), page.split("/")
    return len(parts) == len(names) and all(map(fnmatch.fnmatch, names, parts))


def stage(folder: Path) -> Stage:
    """The pages of the repository in ``folder``."""
    staged = Stage(folder)
    pages = [*ROOT.glob("*.md"), *(page for name in FOLDERS for page in (ROOT / name).rglob("*.md"))]
    for page in sorted(pages):
        staged.page(page)
    for name, make in PAGES.items():
        staged.write(name, make())
    for name in ("fonts", "javascripts", "stylesheets"):
        shutil.copytree(ROOT / "docs" / name, folder / "docs" / name)
    return staged


class _Warnings(logging.Handler):
    """Prints what MkDocs warns of."""

    def emit(self, record: logging.LogRecord) -> None:
        print(f"{record.levelname.lower()}: {record.getMessage()}", file=sys.stderr)


def build_site(out: Path) -> None:
    """Build the site into ``out``, replacing what is there.

    Raises:
        MkDocsException: a page has a broken link, anchor, picture or equation.
    """
    log = logging.getLogger("mkdocs")
    handler = _Warnings(logging.WARNING)
    log.addHandler(handler)
    try:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            staged = stage(folder)
            config = load_config(
                str(ROOT / "docs" / "mkdocs.yml"),
                docs_dir=str(folder),
                site_dir=str(out),
                strict=True,
                not_in_nav="\n".join(f"/{page}" for page in sorted(staged.sources)),
            )
            pages = sorted(page.relative_to(folder).as_posix() for page in folder.rglob("*.md"))
            config.nav = filled_in(config.nav or [], [page for page in pages if page not in staged.sources])
            build(config)
    finally:
        log.removeHandler(handler)


def main() -> None:
    """Exit code 1 if the site has a fault."""
    parser = argparse.ArgumentParser(description="Build the site, strictly.")
    parser.add_argument("--out", type=Path, default=ROOT / "site", help="folder of the site (default: site)")
    parser.add_argument(
        "--pictures",
        action="store_true",
        help=f"first draw pictures: {', '.join(SCRIPTS)}; not {', '.join(LONG_SCRIPTS)}, which take far longer",
    )
    asked = parser.parse_args()
    began = time.monotonic()
    if asked.pictures:
        for script in SCRIPTS:
            subprocess.run([sys.executable, str(ROOT / "docs" / script)], check=True)
    try:
        build_site(asked.out.resolve())
    except MkDocsException as error:
        raise SystemExit(f"{error}") from error
    print(f"{asked.out}/index.html: built in {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
