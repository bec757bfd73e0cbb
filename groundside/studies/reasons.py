"""Reasons why flights were refused or broke off, grouped by kind."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

__all__ = ["Reason", "reasons_in"]

_NUMBER = re.compile(r"(?<![\w.])(?<!\.py:)[-+]?(?:\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|inf\b|nan\b)")
"""A number that stands alone: not the index in ``faults.0``, the gain ``k11``, or a line of a source file."""


@dataclass(frozen=True)
class Reason:
    """Texts that differ only in their numbers."""

    text: str
    """With … in place of numbers that differ."""
    count: int
    example: str
    """The first of the texts."""

    @property
    def line(self) -> str:
        """Return count, text and example as one line."""
        example = f", for example: {self.example}" if self.text != self.example else ""
        return f"{self.count} x {self.text}{example}"


def reasons_in(texts: Iterable[str]) -> list[Reason]:
    """Group texts that differ only in their numbers, the most frequent kind first."""
    kinds: dict[str, list[str]] = {}
    for text in texts:
        kinds.setdefault(_NUMBER.sub("\0", text), []).append(text)
    found = [Reason(_common(kind, members), len(members), members[0]) for kind, members in kinds.items()]
    return sorted(found, key=lambda reason: -reason.count)


def _common(kind: str, members: list[str]) -> str:
    """Return a kind's text with the numbers that all members share, and … for the others."""
    columns = zip(*(_NUMBER.findall(text) for text in members), strict=True)
    shown = [column[0] if len(set(column)) == 1 else "…" for column in columns]
    parts = kind.split("\0")
    return "".join(part + number for part, number in zip(parts, [*shown, ""], strict=True))
