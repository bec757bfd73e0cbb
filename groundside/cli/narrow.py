"""Tables on terminals of any width: no word is cut, no digit lost."""

from __future__ import annotations

from typing import Any

from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Column, Table
from rich.text import Text

__all__ = ["Fitted", "Terminal"]

_ANY = 10_000
"""Columns in which every table finds room."""


class Terminal(Console):
    """A console that prints tables `Fitted`."""

    def print(self, *objects: Any, **options: Any) -> None:
        """As `Console.print`."""
        super().print(*(Fitted(one) if isinstance(one, Table) else one for one in objects), **options)


class Fitted:
    """A table whose columns keep their longest words whole; where they find no room, a paragraph for each row."""

    def __init__(self, table: Table) -> None:
        self._table = table

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        table, wide = self._table, options.update(width=_ANY)
        needs = [_need(console, wide, column) for column in table.columns]
        least, most = [need.minimum for need in needs], [need.maximum for need in needs]
        between = Measurement.get(console, wide, table).maximum - sum(most)
        room = options.max_width - between
        if sum(least) > room:
            yield from self._paragraphs(console)
            return
        if sum(most) > room:
            for column, width in zip(table.columns, _shared(least, most, room), strict=True):
                column.width = width
        yield table

    def _paragraphs(self, console: Console) -> RenderResult:
        """The first cell of each row, and below it the others behind their headings."""
        heads = [_text(console, column.header) for column in self._table.columns]
        for row in zip(*(column.cells for column in self._table.columns), strict=True):
            name, *cells = (_text(console, cell) for cell in row)
            name.stylize("bold")
            yield name
            told = [
                Text.assemble(head, ": ", cell) if head.plain else cell
                for head, cell in zip(heads[1:], cells, strict=True)
                if cell.plain.strip()
            ]
            yield Padding(Text(" · ", overflow="fold").join(told), (0, 0, 0, 2))


def _text(console: Console, cell: Any) -> Text:
    found = cell.copy() if isinstance(cell, Text) else console.render_str(str(cell), highlight=False)
    found.overflow, found.justify = "fold", "left"
    return found


def _need(console: Console, wide: ConsoleOptions, column: Column) -> Measurement:
    """Width of a column: of its longest word, and of its longest cell."""
    cells = [Measurement.get(console, wide, cell) for cell in (column.header, *column.cells)]
    longest = max(cell.maximum for cell in cells)
    return Measurement(longest if column.no_wrap else max(cell.minimum for cell in cells), longest)


def _shared(least: list[int], most: list[int], room: int) -> list[int]:
    """Widths of columns in ``room``: what they need at least, and of the rest as much each, up to what they need."""
    widths = list(least)
    spare = room - sum(widths)
    while spare > 0:
        growing = [n for n, width in enumerate(widths) if width < most[n]]
        for n in growing[:spare]:
            widths[n] += 1
        spare -= len(growing[:spare])
        if not growing:
            break
    return widths
