"""The page of all fields of scenarios and sheets, from the schema that checks them (`groundside/schema`)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from markdown_tables import cell, code, table

from ftcc.groundside.schema import AirframeSheet, Plan, PointMassSheet

__all__ = ["Table", "scenario_fields", "sheet_fields", "tables_of"]

Schema = Mapping[str, Any]


class Table:
    """A table of a file: what it is called there, and its JSON schema."""

    def __init__(self, path: str, listed: bool, schema: Schema) -> None:
        self.path = path
        """Keys joined by dots, ID where an id stands; empty: the top level."""
        self.listed = listed
        """Whether it is a list of tables."""
        self.schema = schema

    @property
    def anchor(self) -> str:
        return "table-" + (re.sub(r"[^a-z0-9]+", "-", self.path.lower()) or "top")

    @property
    def title(self) -> str:
        if not self.path:
            return "Top level"
        return f"`[[{self.path}]]`" if self.listed else f"`[{self.path}]`"


def tables_of(model: Any) -> dict[str, Table]:
    """The tables of a file, by the name of their model, each where it occurs first."""
    whole = model.model_json_schema()
    found = {model.__name__: Table("", False, whole)}

    def visit(schema: Schema, path: str) -> None:
        for name, field in schema.get("properties", {}).items():
            for kind, listed, below in _tables_in(field):
                place = ".".join(part for part in (path, name, below) if part)
                if kind not in found:
                    found[kind] = Table(place, listed, whole["$defs"][kind])
                    visit(found[kind].schema, place)

    visit(whole, "")
    return found


def _tables_in(field: Schema, listed: bool = False, below: str = "") -> Iterator[tuple[str, bool, str]]:
    """The models that a field holds: name, whether it is a list of them, ID if they stand by id."""
    if "$ref" in field:
        yield field["$ref"].rsplit("/", 1)[1], listed, below
    for inner in field.get("anyOf", []):
        yield from _tables_in(inner, listed, below)
    if isinstance(field.get("items"), dict):
        yield from _tables_in(field["items"], True, below)
    for values in _values_by_key(field):
        yield from _tables_in(values, listed, "ID")


def _values_by_key(field: Schema) -> list[Schema]:
    values = [field.get("additionalProperties"), *field.get("patternProperties", {}).values()]
    return [value for value in values if isinstance(value, dict)]


def _kind(field: Schema, tables: Mapping[str, Table]) -> str:
    """The type of a field, as Markdown."""
    if "$ref" in field:
        name = field["$ref"].rsplit("/", 1)[1]
        return f"[table](#{tables[name].anchor})"
    if "anyOf" in field:
        return " or ".join(_kind(inner, tables) for inner in field["anyOf"] if inner.get("type") != "null")
    if "enum" in field or "const" in field:
        return " or ".join(code(json.dumps(one)) for one in field.get("enum", [field.get("const")]))
    if field.get("type") == "array":
        if "prefixItems" in field:
            return "[" + ", ".join(_kind(inner, tables) for inner in field["prefixItems"]) + "]"
        return f"list of {_kind(field.get('items', {}), tables)}"
    if field.get("type") == "object":
        return " or ".join(f"by name or id: {_kind(values, tables)}" for values in _values_by_key(field)) or "table"
    words = {"number": "number", "integer": "whole number", "boolean": "true or false", "string": "text"}
    return words.get(field.get("type", ""), "any value")


def _range(field: Schema) -> str:
    """The values that a field, or each of its numbers, may have."""
    if "anyOf" in field:
        return "; ".join(filter(None, map(_range, field["anyOf"])))
    if field.get("type") == "array":
        inner = field.get("prefixItems", [field.get("items", {})])
        return _range(inner[0])
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    ends = [f"{sign} {_number(field[name])}" for name, sign in signs.items() if name in field]
    return ", ".join(ends)


def _number(value: float) -> str:
    return f"2^{value.bit_length() - 1}" if isinstance(value, int) and value >= 2**53 else f"{value:g}"


def _default(field: Schema, required: bool) -> str:
    if required:
        return "**required**"
    default = field.get("default")
    if default is None:
        return ""
    if isinstance(default, dict):
        return ""
    return code(json.dumps(default))


def _rows(schema: Schema, tables: Mapping[str, Table]) -> Iterator[tuple[str, ...]]:
    required = schema.get("required", [])
    for name, field in schema.get("properties", {}).items():
        meaning = field.get("description", "")
        if not meaning:
            kinds = [kind for kind, _, _ in _tables_in(field)]
            meaning = " ".join(_first_sentence(tables[kind].schema) for kind in kinds)
        yield (
            code(name),
            _kind(field, tables),
            cell(_range(field)),
            _default(field, name in required),
            cell(meaning),
        )


def _first_sentence(schema: Schema) -> str:
    return str(schema.get("description", "")).split("\n\n")[0].replace("\n", " ")


def _section(one: Table, tables: Mapping[str, Table], title: str = "") -> str:
    text = one.schema.get("description", "").replace("``", "`")
    rows = _rows(one.schema, tables)
    fields = table(("field", "type", "range", "default", "unit and meaning"), rows)
    return f"## {title or one.title} {{ #{one.anchor} }}\n\n{text}\n\n{fields}"


def scenario_fields() -> str:
    """The page of the fields of scenarios."""
    tables = tables_of(Plan)
    return "\n".join(
        (
            "# Fields of a scenario",
            "",
            "Every field of a scenario's file, from the schema that checks it. Numbers are finite, in SI units, angles",
            "in rad. An empty default means: not given. A field that is not here is refused, with its line:",
            "",
            "    ftcc check demo",
            "",
            "[Scenarios](../groundside/scenarios/README.md) explains files, forms, variants and claims;",
            "[gains](gains.md) lists what `[gains]`, `[diagnosis.gains]` and `[defence]` take.",
            "",
            *(_section(one, tables) for one in tables.values()),
        )
    )


def sheet_fields() -> str:
    """The page of the fields of airframe sheets."""
    sections = []
    titles = (
        (AirframeSheet, "Six degrees of freedom, or the vertical plane"),
        (PointMassSheet, "A point mass"),
    )
    for model, title in titles:
        tables = tables_of(model)
        one = tables[model.__name__]
        one.path = model.__name__
        sections.append(_section(one, tables, title))
    return "\n".join(
        (
            "# Fields of an airframe sheet",
            "",
            "A sheet is a TOML file. [Your own aircraft](../docs/tutorials/own-aircraft.md) shows how to write one,",
            "and [the shipped ones](../groundside/airframes.md) are examples.",
            "",
            "    ftcc airframe --airspeed 25",
            "",
            *sections,
        )
    )
