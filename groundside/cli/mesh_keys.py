"""The command that makes, renews, copies and lists keys of an encrypted mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ftcc.groundside.cli.common import fail, terminal

__all__ = ["mesh"]

_LAST_UAV = 65535


def mesh(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the keys; made by the first call.")],
    swarm: Annotated[str | None, typer.Option(help="Name of the swarm; needed for a new folder.")] = None,
    uavs: Annotated[str, typer.Option(metavar="1-40", help="UAVs, such as 1-4,7; a certificate for each.")] = "",
    node: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A computer that flies some of them; can be repeated.")
    ] = None,
    lead: Annotated[bool, typer.Option("--lead", help="The leading computer; a new folder always has it.")] = False,
    days: Annotated[float | None, typer.Option(help="For how long certificates are valid; default: 365.")] = None,
    renew: Annotated[
        bool, typer.Option("--renew", help="New keys also for those that have some: for those named, or for all.")
    ] = False,
    bundle: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Copy what one computer needs to a new folder instead.")
    ] = None,
) -> None:
    """Make certificates for an encrypted mesh, or list those of DIR."""
    import ftcc.link.mesh_authority as authority
    from ftcc.link.mesh_keys import AUTHORITY, DAYS, LEAD, MeshKeysError, load_certificate, swarm_of

    try:
        names = _names(uavs, node or [], lead)
        if bundle is not None:
            _only(bundle=True, swarm=swarm, days=days, renew=renew or None)
            if not names:
                fail("--bundle: say for whom, by --uavs, --node or --lead")
            authority.bundle(folder, bundle, names)
            _say(f"copied the keys of {_spoken(names)} to {bundle}; move it to that computer, with its modes (scp -pr)")
            return
        if days is not None and not days > 0.0:
            fail(f"--days {days:g}: must be positive")
        if _is_new(folder):
            if swarm is None:
                fail(f"{folder}: holds no keys; --swarm NAME --uavs 1-4 makes some")
            names = list(dict.fromkeys([*names, LEAD]))
            authority.new_authority(folder, swarm)
        else:
            found = swarm_of(load_certificate(folder, AUTHORITY))
            if swarm is not None and swarm != found:
                fail(f"--swarm {swarm}: {folder} is of swarm {found!r}; another swarm needs another folder")
            if not names and not renew:
                _only(bundle=False, days=days)
                _list(folder)
                return
        made = authority.add_certificates(folder, names or _all(folder), DAYS if days is None else days, renew=renew)
        if not made:
            fail(f"{folder}: {_spoken(names)} have certificates already; --renew makes new ones")
        end = load_certificate(folder, made[0]).not_valid_after_utc
        _say(f"made certificates in {folder} for {_spoken(made)}, valid until {end:%Y-%m-%d %H:%M} UTC")
        if kept := [name for name in names if name not in made]:
            _say(f"kept those of {_spoken(kept)}")
    except MeshKeysError as error:
        fail(str(error))


def _only(*, bundle: bool, **options: object) -> None:
    """Refuse options that mean nothing here."""
    for name, value in options.items():
        if value is not None:
            fail(
                f"--{name}: is for making certificates, {'not for --bundle' if bundle else 'say for whom: --uavs 1-4'}"
            )


def _is_new(folder: Path) -> bool:
    from ftcc.link.mesh_keys import AUTHORITY

    return not (folder / f"{AUTHORITY}.crt").exists()


def _all(folder: Path) -> list[str]:
    from ftcc.link.mesh_keys import names_in

    return names_in(folder)


def _names(uavs: str, nodes: list[str], lead: bool) -> list[str]:
    """The names of certificates that the options ask for."""
    from ftcc.link.mesh_keys import LEAD, node_name, require_word, uav_name

    for node in nodes:
        require_word(node, "a node")
    names = [uav_name(uav) for uav in _numbers(uavs)] + [node_name(node) for node in nodes] + [LEAD] * lead
    return list(dict.fromkeys(names))


def _numbers(text: str) -> tuple[int, ...]:
    """The UAVs of "1-4,7"."""
    from ftcc.groundside.text import ids_of

    try:
        numbers = ids_of(text) if text else ()
    except ValueError as error:
        fail(f"--uavs {error}")
    if numbers and not 1 <= numbers[0] <= numbers[-1] <= _LAST_UAV:
        fail(f"--uavs {text!r}: UAVs are from 1 to {_LAST_UAV}")
    return numbers


def _spoken(names: list[str]) -> str:
    """Names for people, UAVs that follow each other as a range."""
    numbers = sorted(int(name.removeprefix("uav-")) for name in names if name.startswith("uav-"))
    ranges: list[list[int]] = []
    for number in numbers:
        if ranges and ranges[-1][-1] == number - 1:
            ranges[-1].append(number)
        else:
            ranges.append([number])
    uavs = [f"uav-{one[0]}" if len(one) == 1 else f"uav-{one[0]} to uav-{one[-1]}" for one in ranges]
    return ", ".join([*uavs, *(name for name in names if not name.startswith("uav-"))])


def _list(folder: Path) -> None:
    """The certificates of a folder, and when they end."""
    from rich.table import Table

    from ftcc.link.mesh_keys import AUTHORITY, load_certificate, swarm_of

    authority = load_certificate(folder, AUTHORITY)
    makes = "can make more" if (folder / f"{AUTHORITY}.key").exists() else "its key is elsewhere"
    table = Table("name", "valid until (UTC)", title=f"swarm {swarm_of(authority)}, {folder}")
    for name in [*_all(folder), AUTHORITY]:
        end = load_certificate(folder, name).not_valid_after_utc
        table.add_row(name if name != AUTHORITY else f"{AUTHORITY} ({makes})", f"{end:%Y-%m-%d %H:%M}")
    terminal().print(table)


def _say(text: str) -> None:
    terminal().print(text, markup=False, highlight=False, soft_wrap=True)
