"""Tables of claims: many claims in the shape in which a paper prints them, one line a row.

A ``[[table]]`` has ``columns`` and ``rows``; every other key is a field that all its claims share. Where ``columns``
are names, a row is a claim: columns named as fields of a claim hold its fields, all others are cases with what it
expects there; or ``case`` and ``expected`` name the one case of each row and its number. Where ``columns`` are tables,
a column is a claim, and ``rows`` is a table of cases, each with what is expected of it, column by column. ``""`` leaves
a cell empty. ``part`` says where in the shared source a claim stands.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

__all__ = ["FIELDS", "claims_in"]

FIELDS = ("name", "metric", "signal", "uavs", "window", "within", "threshold", "unit", "source", "tolerance")
"""Of a claim, beside ``expected``."""
_EMPTY = ""


def claims_in(table: Any) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    """The claims of a table, each with the place in it.

    Raises
    ------
    ValueError
        Says where in the table: "rows.3: ...".
    """
    if not isinstance(table, dict):
        raise ValueError("must be a table, [[table]]")
    shared = {key: value for key, value in table.items() if key not in ("columns", "rows")}
    columns, rows = table.get("columns"), table.get("rows")
    if not isinstance(columns, list) or not columns:
        raise ValueError("columns: must be a list of names, or of claims")
    if all(isinstance(column, str) for column in columns):
        if len(set(columns)) < len(columns):
            raise ValueError("columns: a name stands there twice")
        yield from _a_claim_a_row(shared, columns, rows)
    elif all(isinstance(column, dict) for column in columns):
        yield from _a_claim_a_column(shared, columns, rows)
    else:
        raise ValueError("columns: must all be names (a row is a claim), or all tables (a column is a claim)")


def _a_claim_a_row(
    shared: dict[str, Any], columns: list[str], rows: Any
) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    if not isinstance(rows, list):
        raise ValueError("rows: must be a list of lists where columns are names")
    for n, row in enumerate(rows):
        cells = _cells(f"rows.{n}", row, len(columns))
        filled = {column: cell for column, cell in zip(columns, cells) if cell != _EMPTY}
        own = {column: cell for column, cell in filled.items() if column in (*FIELDS, "part")}
        expected = {column: cell for column, cell in filled.items() if column not in own}
        if "case" in expected:
            expected[expected.pop("case")] = expected.pop("expected", None)
        yield ("rows", str(n)), _claim(f"rows.{n}", shared, own, expected)


def _a_claim_a_column(
    shared: dict[str, Any], columns: list[dict[str, Any]], rows: Any
) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    if not isinstance(rows, dict):
        raise ValueError("rows: must be a table, [table.rows], case = [numbers], where columns are tables")
    table = {case: _cells(f"rows.{case}", row, len(columns)) for case, row in rows.items()}
    for n, own in enumerate(columns):
        expected = {case: cells[n] for case, cells in table.items() if cells[n] != _EMPTY}
        yield ("columns", str(n)), _claim(f"columns.{n}", shared, own, expected)


def _cells(where: str, row: Any, width: int) -> list[Any]:
    if not isinstance(row, list) or len(row) != width:
        has = f"has {len(row)}" if isinstance(row, list) else "is no list"
        raise ValueError(f'{where}: {has}; must be {width} entries, one for each column ("" where there is none)')
    return row


def _claim(where: str, shared: dict[str, Any], own: dict[str, Any], expected: dict[str, Any]) -> dict[str, Any]:
    if not expected:
        raise ValueError(f"{where}: expects nothing in any case")
    claim = shared | own
    part = claim.pop("part", None)
    if part is not None:
        claim["source"] = f"{claim.get('source', '')}, {part}".removeprefix(", ")
    return claim | {"expected": expected}
