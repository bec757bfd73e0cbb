"""The commands in their sections, and what happens to bad input."""

from __future__ import annotations

import errno
import os
import warnings
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from ftcc.groundside.cli import (
    airframe,
    attacks,
    calibrate,
    failures,
    fly,
    ground,
    identify,
    mesh_keys,
    movie,
    new,
    node,
    results,
    scenarios,
    search,
    study,
    swarms,
    vehicle,
    view,
)
from ftcc.groundside.cli.common import fail, warn
from ftcc.groundside.cli.examples import EXAMPLES
from ftcc.groundside.cli.map import map_
from ftcc.groundside.cli.version import show_versions
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
        new.new,
        scenarios.check,
        scenarios.simulate,
        scenarios.verify,
        study.study,
        map_,
        search.search,
        calibrate.calibrate,
        airframe.airframe,
        identify.identify,
    ),
    "Flights": (fly.fly, node.node, vehicle.vehicle, swarms.ps, swarms.stop, view.watch, swarms.doctor),
    "Results": (results.report, results.export, results.compare, movie.movie, view.replay),
    "Commands to a running swarm": (
        ground.vehicles,
        ground.fault,
        ground.repair,
        failures.failures,
        attacks.attack,
        attacks.attacks,
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


class _Help:
    """Help that ends with an example."""

    def get_help_option(self, ctx: Any) -> Any:
        """A plain flag: typer would load pydantic to find that it was not given."""
        option = super().get_help_option(ctx)  # type: ignore[misc]
        if option is not None:
            option.default = False
        return option

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """The command's example, whole on its line: to be copied."""
        names: list[str] = []
        while ctx.parent is not None:
            names.insert(0, ctx.info_name)
            ctx = ctx.parent
        # However the program was started, here it is called ftcc.
        path = " ".join(("ftcc", *names))
        if path in EXAMPLES:
            formatter.write(f"\nExample:\n  {EXAMPLES[path]}\n")


class _Command(_Help, TyperCommand):
    """A command of ours."""


class _Group(_Help, TyperGroup):
    """A command that has commands of its own."""


class _Sections(_Help, TyperGroup):
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
ground.keys.command("mesh")(mesh_keys.mesh)
for _title, _commands in _SECTIONS.items():
    for _command in _commands:
        if isinstance(_command, typer.Typer):
            for _sub in _command.registered_commands:
                _sub.cls = _Command
            app.add_typer(_command, cls=_Group, rich_help_panel=_title)
        else:
            _name = _command.__name__.removesuffix("_all").removesuffix("_")
            app.command(_name, cls=_Command, rich_help_panel=_title)(_command)


@app.callback(invoke_without_command=True)
def _ftcc(
    ctx: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Show the versions of ftcc and of the libraries it uses.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="With --version: as JSON.")] = False,
    no_color: Annotated[bool, typer.Option("--no-color", help="Print without colours, like NO_COLOR=1.")] = False,
) -> None:
    if no_color:
        # Every console asks for it, in whatever process.
        os.environ["NO_COLOR"] = "1"
    if json and not version:
        fail("--json: here it belongs to --version; for a command, put it behind the command's name")
    if version:
        if ctx.invoked_subcommand is not None:
            fail(f"--version: takes no command, but {ctx.invoked_subcommand} was given")
        show_versions(json)
    elif ctx.invoked_subcommand is None:
        fail("no command given; `ftcc --help` lists them")


def main() -> None:
    """Entry point: bad input, and no room or right to write, end with one message and exit code 2."""
    if "_FTCC_COMPLETE" in os.environ:
        # What knows the shells costs a start, and Typer's own options to install it two lines of help.
        from typer.completion import completion_init  # type: ignore[attr-defined]

        completion_init()
    warnings.showwarning = lambda message, *_, **__: warn(str(message))
    try:
        app()
    except (UserError, NoFolderError) as error:
        fail(str(error))
    except OSError as error:
        if error.errno not in _NO_ROOM:
            raise
        fail(f"{error.filename or 'a file'}: cannot be written: {error.strerror}; free some space, or write elsewhere")
