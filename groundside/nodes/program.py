"""What must be equal on all computers of a swarm, so that it flies the same bits."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
from pathlib import Path

__all__ = ["program"]

_WINGS = ("airside", "link", "sim")
_LIBRARIES = ("ftcc-sitl", "numba", "numpy", "pymavlink", "eclipse-zenoh")


@functools.cache
def program() -> str:
    """Return the versions of the program and of the libraries that compute, and a digest of its sources."""
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for path in sorted(file for wing in _WINGS for file in (root / wing).rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in _LIBRARIES)
    return f"{versions}, sources {digest.hexdigest()[:8]}"
