"""The rooms of groundside: who may import whom, and that a room is entered by its face."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from docs import rooms

GROUNDSIDE = rooms.ROOT / "groundside"
PAGE = rooms.ROOT / "docs" / "architecture.md"
ROOMS = sorted(path.parent.name for path in GROUNDSIDE.glob("*/__init__.py"))


def test_arrows_between_rooms_run_one_way() -> None:
    rooms.floors(rooms.arrows())


def test_the_page_on_architecture_shows_the_imports_as_they_are() -> None:
    """A new arrow is a decision: ``python docs/rooms.py`` draws it and prints the table for the page."""
    assert rooms.table(rooms.rooms()) in PAGE.read_text(encoding="utf-8")
    drawn = (rooms.ROOT / "docs" / "pictures" / "rooms.svg").read_text(encoding="utf-8")
    assert drawn == rooms.picture(rooms.rooms())


def test_what_stands_in_no_room_imports_none() -> None:
    found = {path.name: used_by(path) for path in GROUNDSIDE.glob("*.py")}
    assert not {name: used for name, used in found.items() if used}


def used_by(path: Path) -> set[str]:
    """The rooms that a file imports."""
    names = [node.module for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
    return {room for name in names if (room := rooms.imported_room(name or "")) in ROOMS}


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_is_entered_by_its_face(room: str) -> None:
    """Others import its names from the package, whose ``__init__.pyi`` lists them."""
    deep = []
    for path in GROUNDSIDE.rglob("*.py"):
        if rooms.room_of(path) == room:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"ftcc.groundside.{room}."):
                deep.append(f"{path.relative_to(rooms.ROOT)}:{node.lineno} imports {node.module}")
    assert not deep, "\n".join(deep)


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_has_a_sign_at_its_door(room: str) -> None:
    files = {path.name for path in (GROUNDSIDE / room).glob("*.py") if path.stem not in ("__init__", "__main__")}
    sign = (GROUNDSIDE / room / "README.md").read_text(encoding="utf-8")
    assert not [name for name in files if f"`{name}`" not in sign]
