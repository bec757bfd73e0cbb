"""Compilation of laws, elements and plants, with a cache that notices every edit.

numba's own cache looks only at the file of the calling function: a law would go on flying the old code of an edited
element. Therefore the cache lies in a folder named by the hash of all sources that can be compiled together, and this
module, which sets ``NUMBA_CACHE_DIR``, is the only one that imports numba.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

__all__ = ["SCHEME_ENTRY_POINTS", "cache_folder", "compiled", "copy", "fields", "fill", "instantiate", "store"]

SCHEME_ENTRY_POINTS = "ftcc.schemes"
"""Entry-point group under which other packages offer schemes."""

_KEPT_CACHES = 6
_PACKAGES = ("link", "sim", "airside")

F = TypeVar("F", bound=Callable[..., Any])


def _source_files() -> list[Path]:
    root = Path(__file__).resolve().parent.parent
    found = [path for package in _PACKAGES for path in (root / package).rglob("*.py")]
    found.append(root / "groundside" / "flight_loop.py")
    for entry in importlib.metadata.entry_points(group=SCHEME_ENTRY_POINTS):
        spec = importlib.util.find_spec(entry.module.split(".")[0])
        for place in (spec.submodule_search_locations or []) if spec else []:
            found += Path(place).rglob("*.py")
        if spec and spec.origin and not spec.submodule_search_locations:
            found.append(Path(spec.origin))
    return sorted(set(found))


def _choose_cache_folder() -> Path:
    digest = hashlib.sha256(f"{sys.version} {importlib.metadata.version('numba')}".encode())
    for path in _source_files():
        digest.update(str(path).encode())
        digest.update(path.read_bytes())
    base = Path(os.environ.get("FTCC_CACHE_DIR") or Path.home() / ".cache" / "ftcc") / "compiled"
    folder = base / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    others = sorted((path for path in base.iterdir() if path != folder), key=lambda path: path.stat().st_mtime)
    for stale in others[: max(0, len(others) - _KEPT_CACHES + 1)]:
        shutil.rmtree(stale, ignore_errors=True)
    return folder


cache_folder: Path = _choose_cache_folder()
os.environ["NUMBA_CACHE_DIR"] = str(cache_folder)

import numba  # noqa: E402  (must see NUMBA_CACHE_DIR)
from numba.core import types  # noqa: E402
from numba.extending import overload  # noqa: E402
from numba.np.unsafe.ndarray import to_fixed_tuple  # noqa: E402


def compiled(function: F) -> F:
    """Compile ``function`` on its first call, cached on disk; with ``NUMBA_DISABLE_JIT=1`` it stays plain Python.

    No fast-math and no fused multiply-add: compiled and plain Python give the same bits. Compiled functions work on
    arrays that they are given and allocate none: without reference counting a flight is three times as fast.
    """
    # The cache names its files by file and qualified name; two instances of one template need two names.
    function.__qualname__ = f"{function.__module__}.{function.__qualname__}"
    return numba.njit(cache=True, error_model="numpy", forceinline=True, _nrt=False)(function)  # type: ignore[no-any-return]


def fields(cls: Any, values: Any) -> Any:
    """The NamedTuple ``cls`` (floats only) from the first entries of the vector ``values``."""
    return cls(*values[: len(cls._fields)].tolist())


@overload(fields)
def _fields_compiled(cls, values):
    if not isinstance(cls, types.NamedTupleClass):
        return None
    kind = cls.instance_class
    size = len(kind._fields)
    return lambda cls, values: kind(*to_fixed_tuple(values, size))


@compiled
def store(record, values):
    """Write a tuple of floats into the first entries of the vector ``values``; the inverse of `fields`."""
    for i in range(len(record)):
        values[i] = record[i]


@compiled
def copy(source, target):
    """Copy the vector ``source`` into the beginning of ``target``; an assignment of slices would allocate."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled
def fill(target, value):
    """Set every entry of the vector ``target`` to ``value``."""
    for i in range(target.shape[0]):
        target[i] = value


def instantiate(template: str, name: str, **names: Any) -> ModuleType:
    """Load the module ``template`` once more, as ``template[name]``, with ``names`` already defined in it.

    A compiled function that takes another function as an argument is never cached. A template module whose free names
    are given here is: its functions see the chosen scheme and plant as ordinary globals.
    """
    full_name = f"{template}[{name}]"
    if full_name in sys.modules:
        return sys.modules[full_name]
    spec = importlib.util.find_spec(template)
    if spec is None or spec.origin is None:
        raise ImportError(f"no template module {template}")
    place = importlib.util.spec_from_file_location(full_name, spec.origin)
    assert place is not None
    assert place.loader is not None
    module = importlib.util.module_from_spec(place)
    module.__dict__.update(names)
    sys.modules[full_name] = module
    place.loader.exec_module(module)
    return module
