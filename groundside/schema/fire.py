"""The fields of chapter 9: the fire and the posts around it."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from ftcc.groundside.schema.base import Id, Positive, Strict, check_end

__all__ = ["FireEventFields", "FireFields", "PostFields"]


class PostFields(Strict):
    """A UAV's post: a phase on the fire's border, and an offset from that point."""

    phase: float = Field(description="rad, phi_i")
    north: float = Field(0.0, description="m, delta_i1")
    east: float = Field(0.0, description="m, delta_i2")
    altitude: float = Field(gt=0.0, description="m, delta_i3")


class FireFields(Strict):
    """The elliptical fire-spread model of chapter 9, and the posts of all UAVs around it."""

    spread: tuple[Positive, Positive] = Field(description="m/s, a and b: growth of the northern and eastern half axis")
    age: float = Field(1800.0, gt=0.0, description="s, time since the outbreak at t = 0")
    outbreak: tuple[float, float] = Field((0.0, 0.0), description="m, (x_f0, y_f0): outbreak, north and east")
    drift: tuple[float, float] = Field((0.0, 0.0), description="m/s, motion of its centre, north and east; c")
    omega: float = Field(description="rad/s, angular rate of the UAVs on the ellipse; > 0: from north to east")
    posts: dict[Id, PostFields]
    shift_speed: float = Field(4.0, gt=0.0, description="m/s, largest speed of the formation's centre")
    shift_acceleration: float = Field(0.2, gt=0.0, description="m/s^2, largest acceleration of the formation's centre")
    least_distance: float = Field(20.0, ge=0.0, description="m, least distance between two posts at all times")
    beyond_limits: bool = Field(False, description="true: fly even if the posts demand more than a limit")

    @model_validator(mode="after")
    def _turns(self) -> Self:
        if self.omega == 0.0:
            raise ValueError("omega = 0: the UAVs would have to stand still; must not be 0")
        return self


class FireEventFields(Strict):
    """A new position or drift of the fire's centre from ``at`` on, for all UAVs at once.

    A drift may end: from ``until`` on, the earlier drift applies again. A centre stays where it is.
    """

    at: float = Field(gt=0.0, description="s")
    until: float | None = Field(None, description="s, end of a drift; default: the next event")
    centre: tuple[float, float] | None = Field(None, description="m, north and east at that time; default: unchanged")
    drift: tuple[float, float] | None = Field(None, description="m/s, north and east; default: unchanged")

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        if self.centre is None and self.drift is None:
            raise ValueError("needs some of centre, drift")
        if self.until is not None and self.drift is None:
            raise ValueError("until needs drift; a centre stays where it is")
        check_end(self.at, self.until)
        return self
