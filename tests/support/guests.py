"""Packages with schemes of their own, as pip would install them: files and metadata in a folder, without a network."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path

from ftcc.airside import schemes
from ftcc.link.compiled import SCHEME_ENTRY_POINTS

EXAMPLE = Path(__file__).parents[1] / "example_scheme"


def install(source: Path, target: Path, more: Mapping[str, str] | None = None) -> None:
    """Install the package in ``source`` into ``target``, with ``more`` schemes: their text by module name."""
    project = tomllib.loads((source / "pyproject.toml").read_text())
    name, version = project["project"]["name"], project["project"]["version"]
    offered = dict(project["project"]["entry-points"][SCHEME_ENTRY_POINTS])
    for module in project["tool"]["setuptools"]["py-modules"]:
        shutil.copy(source / f"{module}.py", target)
    for module, text in (more or {}).items():
        (target / f"{module}.py").write_text(text)
        offered[module] = module
    metadata = target / f"{name.replace('-', '_')}-{version}.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    entries = "".join(f"{key} = {value}\n" for key, value in offered.items())
    (metadata / "entry_points.txt").write_text(f"[{SCHEME_ENTRY_POINTS}]\n{entries}")


def forget_schemes() -> None:
    """Look for schemes anew: what is on the path has changed."""
    schemes._modules.cache_clear()
    schemes.find.cache_clear()
