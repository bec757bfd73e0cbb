"""``python docs/rooms.py`` draws who imports whom, wings and the rooms of groundside, from the sources as they are.

It writes ``docs/pictures/rooms.svg`` and the table of imports in ``docs/architecture.md``. An arrow that follows from
others is not drawn.
"""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WINGS = ("airside", "groundside", "link", "sim")

LABELS = {
    "cli": "the command ftcc",
    "studies": "many flights",
    "report": "page, figures",
    "movie": "a film of a run",
    "swarm": "flight with processes",
    "simulation": "flight in one process",
    "dashboard": "live view",
    "doors": "PX4, ArduPilot",
    "nodes": "several computers",
    "results": "a run's folder",
    "generator": "scenarios in a line",
    "jsbsim": "aircraft for JSBSim",
    "templates": "packages to begin with",
    "verdict": "how it went",
    "scenario": "files to specs",
    "claims": "what must hold",
    "statistics": "draws, intervals",
    "schema": "fields, ranges",
    "airside": "laws, autopilot",
    "sim": "aircraft, vehicle",
    "link": "what all agree on",
}


def room_of(path: Path) -> str:
    """The wing of a source file, or in groundside its room; "groundside" for the leaves that stand in no room."""
    wing, *rest = path.relative_to(ROOT).parts
    return rest[0] if wing == "groundside" and len(rest) > 1 else wing


def imported_room(module: str) -> str | None:
    """The room that a module's name stands for; None if it is not ours."""
    package, *parts = module.split(".")
    if package != "ftcc" or not parts:
        return None
    if parts[0] == "groundside" and len(parts) > 1 and (ROOT / "groundside" / parts[1]).is_dir():
        return parts[1]
    return parts[0]


def arrows() -> dict[str, set[str]]:
    """By room, the others that it imports, anywhere in its files."""
    found: dict[str, set[str]] = {}
    for path in (path for wing in WINGS for path in (ROOT / wing).rglob("*.py")):
        own = room_of(path)
        used = found.setdefault(own, set())
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            used |= {room for name in names if (room := imported_room(name)) and room != own}
    return found


def floors(found: dict[str, set[str]]) -> dict[str, int]:
    """By room, the floor on which it stands: one above the highest of those that it imports."""
    known: dict[str, int] = {}

    def floor(room: str, above: tuple[str, ...] = ()) -> int:
        if room in above:
            raise ValueError(f"a circle of imports: {' -> '.join((*above[above.index(room) :], room))}")
        if room not in known:
            known[room] = 1 + max((floor(other, (*above, room)) for other in found[room]), default=-1)
        return known[room]

    for room in found:
        floor(room)
    return known


def needed(found: dict[str, set[str]]) -> list[tuple[str, str]]:
    """The arrows that do not follow from others."""

    def below(room: str) -> set[str]:
        return found[room].union(*(below(other) for other in found[room]))

    return [
        (room, other)
        for room in sorted(found)
        for other in sorted(found[room])
        if not any(other in below(between) for between in found[room])
    ]


def picture(found: dict[str, set[str]]) -> str:
    """An SVG: a box per room on its floor, arrows that point down."""
    width, height, across, down = 170, 50, 200, 92
    level = floors(found)
    top = max(level.values())
    place = {}
    for floor in range(top + 1):
        row = sorted(room for room in found if level[room] == floor)
        for n, room in enumerate(row):
            place[room] = (420 + (n - (len(row) - 1) / 2) * across, 40 + (top - floor) * down)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 840 {80 + top * down}" font-family="sans-serif">',
        '<defs><marker id="tip" markerWidth="9" markerHeight="9" refX="8" refY="4" orient="auto">'
        '<path d="M0,0 L8,4 L0,8 z" fill="#56606b"/></marker></defs>',
        '<rect width="100%" height="100%" fill="#ffffff"/>',
    ]
    for room, other in needed(found):
        (x1, y1), (x2, y2) = place[room], place[other]
        bend = 0.0 if level[room] - level[other] == 1 else (230.0 if x1 == x2 else 110.0)
        y1, y2 = y1 + height / 2, y2 - height / 2
        middle = (y1 + y2) / 2
        lines.append(
            f'<path d="M{x1:g},{y1:g} C{x1 + bend:g},{middle:g} {x2 + bend:g},{middle:g} {x2:g},{y2:g}" '
            'fill="none" stroke="#56606b" stroke-width="1.3" marker-end="url(#tip)"/>'
        )
    for room, (x, y) in sorted(place.items()):
        fill = "#dfeaf6" if room in WINGS else "#fdf3dc"
        lines.append(
            f'<rect x="{x - width / 2:g}" y="{y - height / 2:g}" width="{width}" height="{height}" rx="6" '
            f'fill="{fill}" stroke="#56606b"/>'
            f'<text x="{x:g}" y="{y - 3:g}" font-size="15" font-weight="bold" text-anchor="middle">{room}</text>'
            f'<text x="{x:g}" y="{y + 15:g}" font-size="12" text-anchor="middle">{LABELS[room]}</text>'
        )
    return "\n".join([*lines, "</svg>", ""])


def table(found: dict[str, set[str]]) -> str:
    """The imports as a Markdown table, highest floor first."""
    level = floors(found)
    rows = [
        f"| {room} | {', '.join(sorted(found[room], key=lambda other: (-level[other], other))) or 'nothing'} |"
        for room in sorted(found, key=lambda room: (-level[room], room))
    ]
    return "\n".join(["| room | imports |", "|---|---|", *rows])


def rooms() -> dict[str, set[str]]:
    """The arrows without the leaves of groundside (errors, text, palette, ...), which every room may use."""
    found = arrows()
    found.pop("groundside")
    return {room: used - {"groundside"} for room, used in found.items()}


if __name__ == "__main__":
    (ROOT / "docs" / "pictures" / "rooms.svg").write_text(picture(rooms()), encoding="utf-8")
    page = ROOT / "docs" / "architecture.md"
    before, begin, rest = page.read_text(encoding="utf-8").partition("<!-- rooms -->")
    _, end, after = rest.partition("<!-- /rooms -->")
    page.write_text(f"{before}{begin}\n{table(rooms())}\n{end}{after}", encoding="utf-8")
