"""The fields of references: leaders' profiles and attitude commands."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from ftcc.groundside.schema.base import Id, Strict, check_end

__all__ = ["AttitudeFields", "LeaderFields"]


class Filter(Strict):
    """Second-order filter: natural frequency and damping ratio."""

    frequency: float = Field(gt=0.0, description="rad/s")
    damping: float = Field(gt=0.0, description="damping ratio")


class CommandFields(Strict):
    """A new altitude or speed, from ``at`` on or after leader ``uav`` has passed ``x``.

    From ``until`` on, the earlier command applies again.
    """

    at: float | None = Field(None, ge=0.0, description="s")
    until: float | None = Field(None, description="s, needs at; default: the next command")
    uav: Id | None = Field(None, description="the leader that passes x; default: the own one")
    x: float | None = Field(None, description="m, forward position")
    altitude: float | None = Field(None, description="m; default: unchanged")
    speed: float | None = Field(None, gt=0.0, description="m/s; default: unchanged")

    @model_validator(mode="after")
    def _by_time_or_position(self) -> Self:
        if (self.at is None) == (self.x is None):
            raise ValueError("needs either at = seconds, or x = position (and uav = the leader that passes it)")
        if self.until is not None:
            if self.at is None:
                raise ValueError("until needs at; a command by position holds until the next one")
            check_end(self.at, self.until)
        return self


class CosineFields(Strict):
    """amplitude (cos(frequency (t - at)) - 1) added to the altitude from ``at`` on."""

    at: float = Field(ge=0.0, description="s")
    amplitude: float = Field(description="m")
    frequency: float = Field(gt=0.0, description="rad/s")


class WaveFields(Strict):
    """amplitude sin(frequency t) added to the speed."""

    amplitude: float = Field(description="m/s")
    frequency: float = Field(gt=0.0, description="rad/s")


class LeaderFields(Strict):
    """A leader's commanded motion."""

    x: float = Field(0.0, description="m, forward position at the start")
    y: float = Field(0.0, description="m, lateral position")
    z: float = Field(description="m, altitude at the start")
    V: float = Field(gt=0.0, description="m/s, speed at the start")
    commands: list[CommandFields] = []
    altitude_filter: Filter = Filter(frequency=0.05, damping=0.9)
    speed_filter: Filter = Filter(frequency=0.05, damping=0.95)
    cosine: CosineFields | None = None
    speed_wave: WaveFields | None = None
    over_obstacles: list[float] = Field(
        [],
        description="m, altitude over each obstacle, from its detection until all leaders have passed it; "
        "elsewhere the initial altitude",
    )
    forward: bool = Field(False, description="true: speeds are forward speeds, not airspeeds")
    climb_limit: float | None = Field(
        None, gt=0.0, description="m/s, largest climb rate of the profile; default: the followers' limit"
    )
    sink_limit: float | None = Field(None, gt=0.0, description="m/s, largest sink rate; default: the followers' limit")


class AttitudeCommandFields(Strict):
    """A new commanded attitude relative to the velocity, from ``at`` on; angles that are not given stay.

    From ``until`` on, the earlier attitude is commanded again.
    """

    at: float = Field(ge=0.0, description="s")
    until: float | None = Field(None, description="s; default: the next command")
    bank: float | None = Field(None, gt=-1.5, lt=1.5, description="rad")
    alpha: float | None = Field(None, gt=-1.5, lt=1.5, description="rad, angle of attack")
    sideslip: float | None = Field(None, gt=-1.5, lt=1.5, description="rad")
    uavs: list[Id] | None = Field(None, min_length=1, description="default: all followers")

    @model_validator(mode="after")
    def _commands_something(self) -> Self:
        if self.bank is None and self.alpha is None and self.sideslip is None:
            raise ValueError("needs some of bank, alpha, sideslip")
        check_end(self.at, self.until)
        return self


class AttitudeFields(Strict):
    """Each UAV's own attitude reference: commands through a second-order filter."""

    filter: Filter = Filter(frequency=0.9, damping=0.3)
    commands: list[AttitudeCommandFields] = Field(min_length=1)
