"""What is checked and reserved before a swarm flies: choices, processes, files, ports, the folder."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast, get_args

from ftcc.groundside.results import new_folder
from ftcc.groundside.swarm.control import SwarmError
from ftcc.groundside.swarm.flight import Clock, FlightOptions, Viewer
from ftcc.groundside.swarm.launcher import automatic_pack
from ftcc.groundside.swarm.open_files import provide_files
from ftcc.groundside.swarm.registry import check_name
from ftcc.link.addresses import Address, AddressError, resolve
from ftcc.link.gcs_sockets import LISTENERS
from ftcc.link.mavlink import AUTOPILOT
from ftcc.link.ports import PortBlock, PortError, reserve
from ftcc.link.signing import KeyFileError, Signing, read_key, stamps_file

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["check_choices", "pack_of", "prepare_flight"]

_LAST_SYSTEM = 239
"""Greatest MAVLink system id of a UAV."""


def check_choices(clock: str, speed: float, viewer: str) -> None:
    """Refuse a clock or a viewer that does not exist, and the wall clock without a speed.

    Raises
    ------
    SwarmError
    """
    if clock not in get_args(Clock):
        raise SwarmError(f"--clock {clock}: must be one of {', '.join(get_args(Clock))}")
    if clock == "wall" and math.isinf(speed):
        raise SwarmError(
            "--clock wall --speed max: the wall clock needs a factor; use --clock lockstep to fly as fast as possible"
        )
    if viewer not in get_args(Viewer):
        raise SwarmError(f"--viewer {viewer}: must be one of {', '.join(get_args(Viewer))}")


def prepare_flight(
    mission: Mission,
    folder: str | Path | None,
    *,
    speed: float,
    clock: str = "lockstep",
    hold: bool = False,
    viewer: str = "none",
    open_browser: bool = False,
    record_view: bool = True,
    pack: int | str = 1,
    port: int | None = None,
    mavlink: Sequence[str] | None = None,
    key: Path | None = None,
    id_offset: int = 0,
    tls: Path | None = None,
) -> tuple[FlightOptions, PortBlock]:
    """Check how a mission is to fly, create its folder and reserve its ports.

    Parameters
    ----------
    folder : default: ``runs/SCENARIO-TIME``.
    pack : vehicles per process, or "auto".
    port : first port of the block; default: the first free block.
    mavlink : HOST:PORT of ground stations, or "none"; default: 14550 and 14540.

    Raises
    ------
    UserError
        `SwarmError`, or what `new_folder`, `check_name` and `provide_files` raise; nothing has been started.
    """
    if not mission.wire:
        raise SwarmError(f"form {mission.form!r} has ideal exchange and flies in one process only; use `ftcc simulate`")
    uavs = [spec.uav for spec in mission.vehicles]
    count = pack_of(pack, len(uavs))
    listeners = _listeners_of(mavlink)
    if not 0 <= id_offset <= _LAST_SYSTEM - max(uavs):
        raise SwarmError(
            f"--id-offset {id_offset}: must be from 0 to {_LAST_SYSTEM - max(uavs)} with UAVs up to {max(uavs)}"
        )
    _check_key(key, [uav + id_offset for uav in uavs])
    provide_files(mission, count, len(listeners))
    check_name(f"{mission.name}-20000101-000000-2" if folder is None else Path(folder).name)
    try:
        ports = reserve(uavs, port)
    except PortError as error:
        raise SwarmError(str(error)) from None
    try:
        options = FlightOptions(
            folder=new_folder(mission.name, folder),
            lockstep=clock == "lockstep",
            speed=speed,
            pack=count,
            held=hold,
            viewer=cast("Literal['web', 'native', 'none']", viewer),
            open_browser=open_browser,
            record_view=record_view,
            listeners=listeners,
            key=key,
            id_offset=id_offset,
            tls=tls,
        )
    except BaseException:
        ports.release()
        raise
    return options, ports


def pack_of(given: int | str, uavs: int) -> int:
    """Return the number of vehicles per process that ``--pack`` asks for.

    Raises
    ------
    SwarmError
        If it is neither "auto" nor such a number.
    """
    if given == "auto":
        return automatic_pack(uavs)
    if not str(given).isdecimal() or not 1 <= int(given) <= uavs:
        raise SwarmError(f"--pack {given}: must be 'auto' or a number of vehicles per process from 1 to {uavs}")
    return int(given)


def _listeners_of(given: Sequence[str] | None) -> tuple[Address, ...]:
    """Addresses of ground stations."""
    if given is None:
        return LISTENERS
    found = []
    for text in given:
        if text == "none":
            continue
        try:
            found.append(resolve(text))
        except AddressError as error:
            raise SwarmError(f"--mavlink {text}: {error}") from None
    return tuple(dict.fromkeys(found))


def _check_key(key: Path | None, systems: Iterable[int]) -> None:
    """Refuse a key that cannot be used; warn if what was heard with it cannot be kept."""
    if key is None:
        return
    try:
        secret = read_key(key)
        memories = [Signing(secret, stamps_file(key, system, AUTOPILOT)) for system in systems]
    except KeyFileError as error:
        raise SwarmError(f"--key {error}") from None
    if not all(memory.can_remember() for memory in memories):
        warnings.warn(
            f"--key {key}: the time stamps of received messages cannot be saved beside it, "
            "so commands of this flight could be replayed in the next one",
            stacklevel=3,
        )
