"""The page on ground stations has every command and message that is answered, in the words of the code."""

from __future__ import annotations

from pathlib import Path

from ftcc.airside.gcs import COMMANDS, MESSAGES
from ftcc.link.mavlink import dialect

PAGE = Path(__file__).parents[1] / "docs" / "ground-stations.md"


def test_the_tables_are_those_of_ftcc_commands() -> None:
    _, section = PAGE.read_text(encoding="utf-8").split("## Every command and message")
    rows = [
        line for line in section.splitlines() if line.startswith("| ") and not line.endswith(("does |", "answer |"))
    ]
    names = {n: dialect.enums["MAV_CMD"][n].name.removeprefix("MAV_CMD_") for n in COMMANDS}
    commands = [f"| {number} {names[number]} | {command.does} |" for number, command in sorted(COMMANDS.items())]
    messages = [f"| {name} | {message.does} |" for name, message in sorted(MESSAGES.items())]
    assert rows == commands + messages
