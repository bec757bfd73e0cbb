"""Where the values of a scenario come from: file, block and line."""

from __future__ import annotations

import functools
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ftcc.groundside.scenario.catalogue import Contents, forms_and_variants, text_of

__all__ = ["Layer", "Place", "Places", "line_of"]

_KEY = re.compile(r"[\w+]+(\.[\w+-]+)*")
"""The key at which a problem begins."""


class Layer(NamedTuple):
    """A block that a scenario is merged from."""

    name: str
    """As a user knows it: "base", "form flight", "variant P", "--set duration=20"."""
    file: Path | None
    """None: an option of the command line."""
    path: tuple[str, ...]
    """The keys that lead to it in its file."""
    content: dict[str, Any]


class Place(NamedTuple):
    """Where a value stands."""

    layer: str
    file: Path | None
    line: int | None
    key: str
    """Its key, in that file."""

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else str(self.file or self.layer)


class Places:
    """Where each value of a scenario stands."""

    def __init__(self, contents: Contents, layers: Sequence[Layer]) -> None:
        self._contents = contents
        self._layers = layers

    def of(self, key: str) -> dict[str, Place]:
        """Where the value of ``key``, a path such as "plant.lag.thrust", was given last; that of a table key by key.

        Empty where the scenario does not give it.
        """
        parts = tuple(key.split("."))
        found: dict[tuple[str, ...], Place] = {}
        for layer in reversed(self._layers):
            value, exists = _value(layer.content, parts)
            if exists:
                for leaf in _leaves(value, parts):
                    if not any(leaf[: len(given)] == given or given[: len(leaf)] == leaf for given in found):
                        found[leaf] = self._place(layer, leaf)
            if not isinstance(value, dict):
                break  # this block replaces what stood before it
        return {".".join(leaf): found[leaf] for leaf in sorted(found)}

    def files(self) -> dict[Path, str]:
        """What each file of the scenario holds, in words."""
        contents, document = self._contents, self._contents.document
        held = {}
        for file in contents.files:
            variants = sum(holder == file for holder in contents.variants.values())
            claims = [document["claims"][n] for n, origin in enumerate(contents.claims) if origin.file == file]
            cases = {case for claim in claims for case in claim["expected"]}
            words = []
            if file == contents.files[0]:
                words.append(f"what flies, in form {' or '.join(forms_and_variants(document)[0])}")
            if variants:
                words.append(_counted(variants, "variant"))
            if claims:
                words.append(f"{_counted(len(claims), 'claim')} of {_counted(len(cases), 'case')}")
            if file.name.endswith(".study.toml"):
                words.append("a study")
            if file.name.endswith(".diagnosis.toml"):
                words.append("calibrated thresholds of diagnosis")
            held[file] = "; ".join(words)
        return held

    def located(self, problem: str) -> str:
        """A problem with the file and the line of the key that it begins with."""
        main = self._contents.files[0]
        found = _KEY.match(problem)
        key = found.group() if found else ""
        parts = tuple(key.split("."))
        while parts and (place := self._last(parts)) is None:
            parts = parts[:-1]
        if not parts or place is None:
            return f"{main}: {problem}"
        if place.file is None:
            return f"{main}: {problem} ({place.layer})"
        return f"{place}: {place.key}{problem[len('.'.join(parts)) :]}"

    def _last(self, parts: tuple[str, ...]) -> Place | None:
        for layer in reversed(self._layers):
            value, exists = _value(layer.content, parts)
            if exists:
                return self._place(layer, parts)
            if not isinstance(value, dict):
                return None
        return None

    def _place(self, layer: Layer, parts: tuple[str, ...]) -> Place:
        file, path = layer.file, (*layer.path, *parts)
        if layer.file == self._contents.files[0] and not layer.path:
            # What stands in no form and no variant; claims, variants and study may stand in files beside it.
            if parts[0] == "claims":
                if len(parts) == 1:
                    file, path = self._contents.claims[0].file, self._contents.claims[0].path[:1]
                else:
                    origin = self._contents.claims[int(parts[1])]
                    file, path = origin.file, (*origin.path, *parts[2:])
            elif parts[0] == "variant" and len(parts) > 1:
                file = self._contents.variants[parts[1]]
            elif parts[0] == "study":
                file = next((one for one in self._contents.files if one.name.endswith(".study.toml")), file)
        line = line_of(text_of(file), path) if file else None
        return Place(layer.name, file, line, ".".join(path[len(layer.path) :]))


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"


def _value(node: Any, parts: Sequence[str]) -> tuple[Any, bool]:
    """What stands at ``parts``; or the last thing on the way that is there (a table that lacks the rest), and False."""
    for part in parts:
        if isinstance(node, dict):
            if part not in node:
                return {}, False
            node = node[part]
        elif isinstance(node, list) and part.isdecimal() and int(part) < len(node):
            node = node[int(part)]
        else:
            return None, False
    return node, True


def _leaves(value: Any, parts: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from _leaves(inner, (*parts, key))
    else:
        yield parts


def line_of(text: str, path: Sequence[str]) -> int | None:
    """The line, counted from 1, of a TOML text on which the value at ``path`` begins; of what holds it, if that is all
    that can be told."""
    wanted = tuple(path)
    best: tuple[int, int] | None = None
    for line, lines, here, value in _statements(text):
        common = min(len(here), len(wanted))
        if here[:common] != wanted[:common] or not here:
            continue
        if best is None or (len(here) <= len(wanted) and common > best[0]):
            best = common, line + _element(lines, value, wanted[common:])
    return best[1] if best else None


@functools.lru_cache(maxsize=4)
def _statements(text: str) -> list[tuple[int, list[str], tuple[str, ...], Any]]:
    """First line, lines, keys from the top and value of each statement: a table's header, or a key with its value."""
    found = []
    table: tuple[str, ...] = ()
    counts: dict[tuple[str, ...], int] = {}
    pending: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        pending.append(line)
        try:
            said = tomllib.loads("\n".join(pending))
        except tomllib.TOMLDecodeError:
            continue  # goes on in the next line
        lines, pending = pending, []
        if not said:
            continue
        header = lines[0].lstrip().startswith("[")
        keys, value = _descend(said, header)
        if not header:
            found.append((number - len(lines) + 1, lines, (*table, *keys), value))
            continue
        table = ()
        for n, key in enumerate(keys):
            table = (*table, key)
            if isinstance(value, list) and n == len(keys) - 1:
                counts[table] = counts.get(table, -1) + 1
            if table in counts:
                table = (*table, str(counts[table]))
        found.append((number, lines, table, None))
    return found


def _descend(said: Any, header: bool) -> tuple[tuple[str, ...], Any]:
    """The keys of a statement and its value."""
    keys: tuple[str, ...] = ()
    while isinstance(said, dict) and len(said) == 1 and (header or not keys):
        (key, said), *_ = said.items()
        keys = (*keys, key)
    return keys, said


def _element(lines: list[str], value: Any, rest: Sequence[str]) -> int:
    """How many lines below the first one an element of a list stands that has a line for each."""
    if not isinstance(value, list) or not rest or not rest[0].isdecimal():
        return 0
    filled = [n for n, line in enumerate(lines[1:-1], 1) if line.strip() and not line.lstrip().startswith("#")]
    return filled[int(rest[0])] if len(filled) == len(value) and int(rest[0]) < len(filled) else 0
