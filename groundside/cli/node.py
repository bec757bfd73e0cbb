"""The command ``ftcc node``."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftcc.groundside.cli.common import Out, fail, load_mission, scenario_names

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["Insecure", "Tls", "check_secrecy", "node", "refused_keys"]

_FAILED = 1

Tls = Annotated[
    Path | None, typer.Option("--tls", metavar="DIR", help="Encrypt by the keys in this folder, see `ftcc keys mesh`.")
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Let the swarm speak in plain text between computers, to everybody.")
]


@contextlib.contextmanager
def refused_keys() -> Iterator[None]:
    """End with one line and exit code 2 where keys of the mesh cannot be used."""
    from ftcc.link.mesh_keys import MeshKeysError

    try:
        yield
    except MeshKeysError as error:
        fail(f"--tls {error}")


def check_secrecy(tls: Path | None, insecure: bool) -> None:
    """Refuse plain traffic between computers that nobody asked for."""
    if tls is None and not insecure:
        fail("traffic between computers must be encrypted: give --tls DIR (see `ftcc keys mesh`), or say --insecure")
    if tls is not None and insecure:
        fail("--tls and --insecure: give one of them")


def node(
    scenario: Annotated[
        str,
        typer.Argument(help="The only scenario to fly; default: what the swarm flies.", autocompletion=scenario_names),
    ] = "",
    join: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Where the leading computer listens: `listen` of its nodes.toml.")
    ] = "",
    name: Annotated[str, typer.Option(help="Name of this node in nodes.toml; default: the computer's name.")] = "",
    uavs: Annotated[str, typer.Option(metavar="IDS", help="The only UAVs to fly, such as 1-40.")] = "",
    vehicles: Annotated[str, typer.Option(metavar="IDS", help="The only further vehicles to fly.")] = "",
    autopilots: Annotated[str, typer.Option(metavar="IDS", help="The only further autopilots to fly.")] = "",
    address: Annotated[str, typer.Option(help="Address at which the others reach this computer.")] = "",
    tls: Tls = None,
    insecure: Insecure = False,
    key: Annotated[
        Path | None, typer.Option(help="Key file of the links to the ground, where the swarm signs them.")
    ] = None,
    out: Out = None,
) -> None:
    """Fly a share of a swarm that `ftcc fly --nodes` leads on another computer."""
    from ftcc.groundside.nodes import NodeOptions, run_node
    from ftcc.groundside.results import new_folder
    from ftcc.link.addresses import AddressError, resolve

    check_secrecy(tls, insecure)
    if not join:
        fail("--join HOST:PORT is missing: where the leading computer listens")
    name = name or socket.gethostname().partition(".")[0]
    try:
        lead = resolve(join)
    except AddressError as error:
        fail(f"--join {join}: {error}")
    given = bool(uavs or vehicles or autopilots)
    both = _ids("--uavs", uavs)
    options = NodeOptions(
        lead=lead,
        name=name,
        scenario=Path(scenario).stem if scenario.endswith(".toml") else scenario,
        vehicles=tuple(sorted({*both, *_ids("--vehicles", vehicles)})) if given else None,
        autopilots=tuple(sorted({*both, *_ids("--autopilots", autopilots)})) if given else None,
        address=address,
        tls=tls,
        key=key,
    )

    def load(folder: Path) -> Mission:
        return load_mission(str(folder), None, "", None, None, None)

    with refused_keys():
        ended = run_node(
            options, load, lambda flown: new_folder(f"{flown}-{name}", out), lambda text: print(text, flush=True)
        )
    if not ended:
        raise typer.Exit(_FAILED)


def _ids(option: str, text: str) -> tuple[int, ...]:
    from ftcc.groundside.text import ids_of

    try:
        return ids_of(text) if text else ()
    except ValueError as error:
        fail(f"{option} {error}")
