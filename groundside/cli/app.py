"""The commands in their sections, and what happens to bad input."""

from __future__ import annotations

import errno
import warnings
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand, TyperGroup

from ftcc.groundside.cli import airframe, failures, fly, ground, results, scenarios, study, view
from ftcc.groundside.cli.common import fail, warn
from ftcc.groundside.errors import UserError
from ftcc.link.folders import NoFolderError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["app", "main"]

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES)
"""What keeps files from being written that is nobody's mistake here."""

_SECTIONS: dict[str, tuple[Callable[..., Any] | typer.Typer, ...]] = {
    "Scenarios": (
        scenarios.list_all,
        scenarios.check,
        scenarios.simulate,
        scenarios.verify,
        study.study,
        airframe.airframe,
    ),
    "Flights": (fly.fly, fly.ps, fly.stop, view.watch, fly.doctor),
    "Results": (results.report, results.compare, view.replay),
    "Commands to a running swarm": (
        ground.vehicles,
        ground.fault,
        ground.repair,
        failures.failures,
        ground.commands,
        ground.link,
        ground.ftc,
        ground.leader,
        ground.attitude,
        ground.mode,
        ground.param,
        ground.pause,
        ground.step,
        ground.resume,
        ground.speed,
        ground.keys,
    ),
}


class _LightHelp:
    """A command whose ``--help`` is a plain flag: typer would load pydantic to find that it was not given."""

    def get_help_option(self, ctx: Any) -> Any:
        option = super().get_help_option(ctx)  # type: ignore[misc]
        if option is not None:
            option.default = False
        return option


class _Command(_LightHelp, TyperCommand):
    """A command of ours."""


class _Sections(_LightHelp, TyperGroup):
    """Help that lists the commands by section."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        sections: dict[str, list[tuple[str, str]]] = {}
        room = formatter.width - 6 - max(map(len, self.commands))
        for name in self.list_commands(ctx):
            command: Any = self.get_command(ctx, name)
            sections.setdefault(command.rich_help_panel, []).append((name, command.get_short_help_str(room)))
        for title, rows in sections.items():
            with formatter.section(title):
                formatter.write_dl(rows)


app = typer.Typer(
    name="ftcc",
    cls=_Sections,
    help="Software in the loop for swarms of fixed-wing UAVs under fault-tolerant cooperative control.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"max_content_width": 110},
)
for _title, _commands in _SECTIONS.items():
    for _command in _commands:
        if isinstance(_command, typer.Typer):
            app.add_typer(_command, rich_help_panel=_title)
        else:
            app.command(_command.__name__.removesuffix("_all"), cls=_Command, rich_help_panel=_title)(_command)


def main() -> None:
    """Entry point: bad input, and no room or right to write, end with one message and exit code 2."""
    warnings.showwarning = lambda message, *_, **__: warn(str(message))
    try:
        app()
    except (UserError, NoFolderError) as error:
        fail(str(error))
    except OSError as error:
        if error.errno not in _NO_ROOM:
            raise
        fail(f"{error.filename or 'a file'}: cannot be written: {error.strerror}; make room, or write elsewhere")
