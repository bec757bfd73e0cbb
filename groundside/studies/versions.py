"""Which program flies: its version, and a digest of its sources, by which workers of a cluster are compared."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import importlib.util
import platform
from pathlib import Path

from ftcc.link.cache import SCHEME_ENTRY_POINTS

__all__ = ["difference", "versions"]

_LIBRARIES = ("ftcc-sitl", "numba", "numpy", "scipy")
_WINGS = ("airside", "groundside", "link", "sim")
_SUFFIXES = (".py", ".toml")


@functools.cache
def versions() -> dict[str, str]:
    """Return versions on which the numbers of a flight may depend, and ``sources``, a digest of the program."""
    found = {name: importlib.metadata.version(name) for name in _LIBRARIES}
    return found | {"python": platform.python_version(), "machine": platform.machine(), "sources": _digest()}


def difference(theirs: dict[str, str]) -> str:
    """Return in words how versions differ from those of this program; empty if they do not."""
    ours = versions()
    parts = []
    for name in (*ours, *(name for name in theirs if name not in ours)):
        here, there = ours.get(name), theirs.get(name)
        if here != there:
            parts.append("other sources" if name == "sources" else f"{name} {there} instead of {here}")
    return ", ".join(parts)


def _digest() -> str:
    """Return a digest of all sources, the same wherever they lie."""
    root = Path(__file__).resolve().parents[2]
    places = [(wing, root / wing) for wing in _WINGS]
    for entry in importlib.metadata.entry_points(group=SCHEME_ENTRY_POINTS):
        spec = importlib.util.find_spec(entry.module.split(".")[0])
        if spec and spec.origin:
            package = bool(spec.submodule_search_locations)
            places.append((entry.name, Path(spec.origin).parent if package else Path(spec.origin)))
    digest = hashlib.sha256()
    for name, place in sorted(places):
        files = [place] if place.is_file() else sorted(place.rglob("*"))
        for path in files:
            if path.suffix in _SUFFIXES and path.is_file():
                digest.update(f"{name}/{path.relative_to(place).as_posix()}\0".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
