"""What an installation that is no link to the sources must contain."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
WINGS = ("airside", "groundside", "link", "sim")


def test_every_package_is_installed() -> None:
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    folders = {path.parent.relative_to(ROOT) for wing in WINGS for path in (ROOT / wing).rglob("__init__.py")}
    assert set(listed) == {".".join(("ftcc", *folder.parts)) for folder in folders}
