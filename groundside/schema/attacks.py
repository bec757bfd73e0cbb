"""The fields of UAVs that lie to their neighbours, and of what protects the network."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from ftcc.groundside.schema.base import Id, Strict, check_end
from ftcc.link.attacks import KINDS

__all__ = ["AttackFields", "NetworkFields"]

Size = Annotated[float, Field(ge=-1e6, le=1e6)]
Time = Annotated[float, Field(gt=0.0, le=1e4)]


class NetworkFields(Strict):
    """What protects the records between UAVs."""

    authenticated: bool = Field(False, description="true: nobody can speak in another UAV's name")


class AttackFields(Strict):
    """A lie to the neighbours from ``at`` to ``until``: of one UAV, of several, or on one edge.

    offset: a constant error ``size``; drift: one that grows by ``rate``, up to ``size``; freeze: the values of the
    beginning; replay: what was told ``delay`` ago, or, with ``period``, a window of the past again and again; noise:
    white, of standard deviation ``size``; oscillate: ``size`` and ``period``; opposite: mirrored about its value at the
    beginning, an error about zero; collude: several UAVs tell the target ``size``, which moves by ``rate``, and come
    there within ``onset``; sybil: the values of the UAV in the name of UAV ``as``, with ``size`` added.
    """

    at: float = Field(ge=0.0, description="s")
    until: float | None = Field(None, description="s, from when on the truth is told; default: the attack is permanent")
    kind: Literal["offset", "drift", "freeze", "replay", "noise", "oscillate", "opposite", "collude", "sybil"] = Field(
        description="see above"
    )
    uav: Id | None = Field(None, description="who lies to everybody")
    uavs: list[Id] | None = Field(None, min_length=1, description="several that do")
    edge: tuple[Id, Id] | None = Field(None, description="[sender, receiver]: lies to this receiver alone")
    victim: Id | None = Field(None, alias="as", description="sybil: in whose name the UAV speaks")
    signals: list[str] = Field([], description="names of shared values; default: all that are no rates")
    consistent: bool = Field(True, description="false: the rate of a value stays true where one is shared")
    size: Size | dict[str, Size] | None = Field(None, description="unit of the signal; one number, or by signal")
    rate: Size | dict[str, Size] | None = Field(None, description="unit of the signal per s; one number, or by signal")
    period: Time | None = Field(None, description="s, of an oscillation; length of a window that is replayed")
    delay: Time | None = Field(None, description="s, how far back a replay looks")
    onset: Time | None = Field(None, description="s, in which collude comes to its target; default: at once")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_end(self.at, self.until)
        if [self.uav, self.uavs, self.edge].count(None) != 2:
            raise ValueError("needs one of uav = n, uavs = [..] and edge = [sender, receiver]")
        if self.edge is not None and self.edge[0] == self.edge[1]:
            raise ValueError("edge: a UAV does not hear itself")
        if self.uavs is not None and len(set(self.uavs)) < len(self.uavs):
            raise ValueError("uavs: a UAV is listed twice")
        kind = KINDS[self.kind]
        given = self.given
        if missing := [name for name in kind.needs if name not in given]:
            raise ValueError(f'kind = "{self.kind}" needs {", ".join(missing)}')
        if extra := [name for name in given if name not in (*kind.needs, *kind.takes)]:
            raise ValueError(f'kind = "{self.kind}" takes no {", ".join(extra)}')
        if self.kind == "collude" and len(self.uavs or ()) < 2:
            raise ValueError('kind = "collude" needs uavs = [..] with at least two UAVs; one alone: offset or drift')
        if self.kind == "sybil":
            if self.uavs is not None:
                raise ValueError('kind = "sybil" needs one UAV that speaks: uav = n, or edge = [n, receiver]')
            if self.victim in (self.uav, *(self.edge or ())):
                raise ValueError(f"as = {self.victim}: must be another UAV than who speaks, and than who hears it")
        if self.kind == "replay" and self.period is not None and self.delay is not None and self.period > self.delay:
            raise ValueError(f"period = {self.period:g}: the window must be over at = {self.at:g}: at most the delay")
        return self

    @property
    def given(self) -> dict[str, Any]:
        """The fields of single kinds that are given, by their names in a file."""
        names = {"size": "size", "rate": "rate", "period": "period", "delay": "delay", "onset": "onset", "victim": "as"}
        return {name: getattr(self, field) for field, name in names.items() if getattr(self, field) is not None}

    @property
    def liars(self) -> tuple[int, ...]:
        """Ids of those who lie."""
        return (self.edge[0],) if self.edge else tuple(self.uavs or ()) or (self.uav or 0,)
