"""numba's cache on disk, which here notices every edit, and to which several processes may add at a time.

numba's own looks only at the file of the calling function: a law would go on flying the old code of an edited element.
Therefore it lies in the folder of `cache`, which is named by the hash of all sources that can be compiled together; a
law from another package, with what is compiled for it alone, has a folder of its own. This module says so to numba,
and is the first to import it.
"""

from __future__ import annotations

import itertools
import os
import sys
from pathlib import Path
from typing import Any

from ftcc.link import cache

__all__ = ["GUEST", "CacheFile", "cache_folder", "index_of", "is_guest"]

cache_folder: Path = cache.folder()
os.environ["NUMBA_CACHE_DIR"] = str(cache_folder)
os.environ["NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING"] = "1"  # what it says is read, see `numba_messages`

from numba.core import caching  # noqa: E402  (must see both)
from numba.core.caching import CacheImpl, IndexDataCacheFile, UserProvidedCacheLocator  # noqa: E402
from numba.core.types.containers import BaseTuple  # noqa: E402

_OURS = __name__.split(".")[0] + "."
GUEST = "__guest__"
"""Name, in a template, that says whether it is filled in with a law from another package."""


def is_guest(module: Any) -> bool:
    """Whether a module, or the module of that name, belongs to another package, or is filled in with one that does."""
    name = module if isinstance(module, str) else module.__name__
    return not name.startswith(_OURS) or bool(getattr(module, GUEST, False))


def _names_guest(kind: Any) -> bool:
    """Whether numba's type ``kind`` is, or is made of, a class of another package."""
    if isinstance(kind, tuple | list):
        return any(map(_names_guest, kind))
    made = getattr(kind, "instance_class", None)
    if made is not None and is_guest(made.__module__):
        return True
    return isinstance(kind, BaseTuple) and any(map(_names_guest, kind.types))


class CacheFile(IndexDataCacheFile):  # type: ignore[misc]
    """Compiled code of one function on disk, to which several processes may add at a time.

    numba itself reads the index, picks the next free file and writes both, without a lock: of two processes that
    compile one function for different types, one may leave an index that names the other's code. Such code is called
    with arguments of other types, and may do anything: crash, or never return.
    """

    def load(self, key: Any) -> Any:
        """The code for the types ``key``; None where there is none that can be read: then it is compiled again."""
        try:
            return super().load(key)
        except Exception:  # a damaged file, as after a power cut, makes pickle raise anything
            return None

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:  # as above
            return {}

    def save(self, key: Any, data: Any) -> None:
        """Add the code ``data`` for the types ``key``; where it cannot be written, the next start compiles again.

        What a function of ours does with records of a law from elsewhere is not kept: it would outlive their edit.
        """
        if self._cache_path.startswith(str(cache_folder)) and _names_guest(key[0]):
            return
        try:
            with cache.alone(cache_folder):
                os.makedirs(self._cache_path, exist_ok=True)
                overloads = self._load_index()
                known = set(overloads.values())
                free = (name for n in itertools.count(1) if (name := self._data_name(n)) not in known)
                name = overloads.get(key) or next(free)
                # The code first: the index must not name a file that is not there yet.
                self._save_data(name, data)
                if key not in overloads:
                    self._save_index(overloads | {key: name})
        except OSError as error:
            cache.not_kept(error)


class _Locator(UserProvidedCacheLocator):  # type: ignore[misc]
    """Uses the folder of `cache` even where it cannot be written: numba would fall back to ``__pycache__``, which does
    not notice an edit elsewhere."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        if is_guest(sys.modules.get(function.__module__, function.__module__)):
            self._cache_path = str(cache.guest_folder() / self.get_suitable_cache_subpath(file))

    def ensure_cache_path(self) -> None:
        """Do nothing: `CacheFile.save` creates it."""


# For every function of this process, also one that somebody's law compiles with numba itself.
CacheImpl._locator_classes = [_Locator]
caching.IndexDataCacheFile = CacheFile


def index_of(function: Any) -> Path:
    """The file of the cache that lists for which types there is code of a compiled function."""
    return Path(function._cache._cache_file._index_path)
