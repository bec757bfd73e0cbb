"""The fields of communication: graph, channel, and link events."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from ftcc.groundside.schema.base import Id, Probability, Strict, check_end

__all__ = ["ChannelFields", "EdgeFields", "GraphFields", "LinkEventFields"]


class EdgeFields(Strict):
    """An edge of the communication graph: ``between`` two UAVs (both ways), or ``from`` a sender ``to`` a receiver."""

    between: tuple[int, int] | None = Field(None, description="ids of two UAVs that hear each other")
    sender: int | None = Field(None, alias="from", description="id of the UAV that is heard")
    receiver: int | None = Field(None, alias="to", description="id of the UAV that hears it")
    weight: float = Field(gt=0.0, description="a_ij of the monograph")

    @model_validator(mode="after")
    def _one_way_of_saying(self) -> Self:
        both = self.between is not None
        directed = (self.sender is not None, self.receiver is not None)
        if both == any(directed) or any(directed) != all(directed):
            raise ValueError("needs either between = [a, b], or from = a and to = b")
        if len({*(self.between or (self.sender, self.receiver))}) == 1:
            raise ValueError("a UAV cannot be its own neighbour")
        return self

    @property
    def directed(self) -> list[tuple[int, int]]:
        """Pairs (receiver, sender)."""
        if self.between is not None:
            a, b = self.between
            return [(a, b), (b, a)]
        assert self.receiver is not None
        assert self.sender is not None
        return [(self.receiver, self.sender)]


class GraphFields(Strict):
    """The communication graph."""

    edges: list[EdgeFields] = []


class ChannelFields(Strict):
    """Quality of the radio links."""

    loss: Probability = Field(0.0, description="probability of loss of a record, independent")
    burst_start: Probability = Field(0.0, description="probability per record that a burst begins")
    burst_end: Probability = Field(1.0, description="probability per record that a burst ends")
    burst_loss: Probability = Field(1.0, description="probability of loss within a burst")
    delay: float = Field(0.0, ge=0.0, description="s, in addition to the link latency")
    jitter: float = Field(0.0, ge=0.0, description="s, further delay, uniform in [0, jitter]")


class LinkEventFields(Strict):
    """A change of the radio of one UAV, or of one edge, from ``at`` to ``until``."""

    at: float = Field(ge=0.0, description="s")
    until: float | None = Field(None, description="s; default: the change is permanent")
    kind: Literal["cut", "degrade"] = Field(description="nothing arrives, or the quality changes")
    uav: Id | None = Field(None, description="its radio, in both directions")
    edge: tuple[Id, Id] | None = Field(None, description="[sender, receiver]")
    directed: bool = Field(False, description="only sender -> receiver")
    loss: Probability | None = Field(None, description="probability of loss of a record")
    burst_start: Probability | None = Field(None, description="probability per record that a burst begins")
    burst_end: Probability | None = Field(None, description="probability per record that a burst ends")
    burst_loss: Probability | None = Field(None, description="probability of loss within a burst")
    delay: float | None = Field(None, ge=0.0, description="s")
    jitter: float | None = Field(None, ge=0.0, description="s")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.uav is None) == (self.edge is None):
            raise ValueError("needs either uav = n or edge = [sender, receiver]")
        check_end(self.at, self.until)
        if self.directed and self.edge is None:
            raise ValueError("directed goes with edge")
        if bool(self.changes) != (self.kind == "degrade"):
            allowed = ", ".join(ChannelFields.model_fields)
            raise ValueError(f'kind = "degrade" needs, and only it takes, some of {allowed}')
        return self

    @property
    def changes(self) -> dict[str, float]:
        """The channel parameters that are given."""
        given = {name: getattr(self, name) for name in ChannelFields.model_fields}
        return {name: value for name, value in given.items() if value is not None}
