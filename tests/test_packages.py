"""What an installation must contain, and what tools must find without running it."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

from tests import typings

ROOT = Path(__file__).parent.parent
WINGS = ("airside", "groundside", "link", "sim")


def test_every_package_is_installed() -> None:
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    folders = {path.parent.relative_to(ROOT) for wing in WINGS for path in (ROOT / wing).rglob("__init__.py")}
    assert set(listed) == {".".join(("ftcc", *folder.parts)) for folder in folders}


def test_every_import_is_found_by_tools_that_do_not_run_python(tmp_path: Path) -> None:
    typings.make(tmp_path)
    missing = []
    for source in (path for wing in WINGS for path in (ROOT / wing).rglob("*.py")):
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("ftcc."):
                continue
            place = tmp_path.joinpath(*node.module.split("."))
            file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
            names = {line.rsplit(" ", 1)[1] for line in file.read_text(encoding="utf-8").splitlines()}
            modules = {path.stem for path in place.iterdir()} if place.is_dir() else set()
            missing += [f"{source}: {alias.name}" for alias in node.names if alias.name not in names | modules]
    assert not missing, missing
