"""Which computer flies which UAVs: ``nodes.toml``, read and checked."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, model_validator

from ftcc.groundside.errors import UserError
from ftcc.groundside.schema import Strict
from ftcc.groundside.text import ids, ids_of
from ftcc.link.addresses import AddressError, resolve

__all__ = ["NodeFields", "NodesError", "NodesPlan", "as_ids", "read_plan"]


class NodesError(UserError):
    """A plan, or a computer, with which the swarm cannot fly."""


def as_ids(given: Any) -> Any:
    """Return ids given as a text such as "1-6, 8" as a tuple; anything else as it is."""
    return ids_of(given) if isinstance(given, str) else given


def _resolvable(address: str) -> str:
    try:
        resolve(address)
    except AddressError as error:
        raise ValueError(str(error)) from None
    return address


def _plain_name(name: str) -> str:
    if not name.replace("-", "").replace("_", "").isalnum() or name == "lead":
        raise ValueError("must be letters, digits, - and _, and not 'lead'")
    return name


Ids = Annotated[tuple[int, ...], BeforeValidator(as_ids)]
Name = Annotated[str, AfterValidator(_plain_name)]


class NodeFields(Strict):
    """One computer beside the leading one."""

    name: Name = Field(description="by which logs and messages call it, and its certificate")
    uavs: Ids = Field((), description='ids, such as "1-4": vehicles and autopilots that fly there')
    vehicles: Ids = Field((), description="further vehicles alone, whose autopilots fly elsewhere")
    autopilots: Ids = Field((), description="further autopilots alone, whose vehicles fly elsewhere")
    ssh: str = Field("", description="user@host at which `ftcc fly --ssh` starts it")
    command: str = Field("ftcc", description="the program there, for --ssh")
    tls: str = Field("", description="folder of keys there, for --ssh")

    @model_validator(mode="after")
    def _flies_something(self) -> NodeFields:
        if not (self.uavs or self.vehicles or self.autopilots):
            raise ValueError("needs uavs, vehicles or autopilots")
        return self


class NodesPlan(Strict):
    """The computers of a swarm. What is placed nowhere flies on the leading computer."""

    listen: Annotated[str, AfterValidator(_resolvable)] = Field(
        description="HOST:PORT at which the nodes reach the leading computer"
    )
    timeout: float = Field(30.0, ge=2.0, le=3600.0, description="s, silence after which a computer counts as gone")
    largest_offset: float = Field(
        0.01, gt=0.0, le=1.0, description="s, between the clocks of two computers, with --clock wall"
    )
    known_addresses: bool = Field(
        True,
        description="with --tls: callers from addresses at which no node has joined are ignored; false where a "
        "computer calls from other addresses than that at which it is reached",
    )
    nodes: list[NodeFields] = Field(min_length=1)

    @model_validator(mode="after")
    def _each_placed_once(self) -> NodesPlan:
        _refuse_twice("name", [node.name for node in self.nodes])
        _refuse_twice("the vehicle of UAV", [uav for node in self.nodes for uav in (*node.uavs, *node.vehicles)])
        _refuse_twice("the autopilot of UAV", [uav for node in self.nodes for uav in (*node.uavs, *node.autopilots)])
        return self

    def vehicle_at(self, uav: int) -> str:
        """Return the name of the node on which a vehicle flies; "" for the leading computer."""
        return next((node.name for node in self.nodes if uav in node.uavs or uav in node.vehicles), "")

    def autopilot_at(self, uav: int) -> str:
        """Return the name of the node on which an autopilot flies; "" for the leading computer."""
        return next((node.name for node in self.nodes if uav in node.uavs or uav in node.autopilots), "")

    def place(self, uav: int) -> tuple[str, str]:
        """Return where the vehicle and the autopilot of a UAV fly."""
        return self.vehicle_at(uav), self.autopilot_at(uav)

    def require_in(self, uavs: Iterable[int]) -> None:
        """Refuse UAVs that the swarm does not have.

        Raises
        ------
        NodesError
        """
        known = set(uavs)
        for node in self.nodes:
            strange = {*node.uavs, *node.vehicles, *node.autopilots} - known
            if strange:
                raise NodesError(f"node {node.name}: there is no UAV {ids(strange)}; the swarm has {ids(known)}")


def _refuse_twice(what: str, given: list[Any]) -> None:
    for one in given:
        if given.count(one) > 1:
            raise ValueError(f"{what} {one} is there twice")


def read_plan(path: Path) -> NodesPlan:
    """Read ``nodes.toml``.

    Raises
    ------
    NodesError
        If it cannot be read, with the field and what would be right.
    """
    try:
        return NodesPlan.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise NodesError(f"--nodes {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise NodesError(f"--nodes {path}: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise NodesError(
            f"--nodes {path}: {place + ': ' if place else ''}{first['msg'].removeprefix('Value error, ')}"
        ) from None
