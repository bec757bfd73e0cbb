"""The fields of the surroundings and faults: obstacles, disturbances, faults, home, noise."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from ftcc.groundside.schema.base import Actuator, Id, Probability, Strict, check_end, extended
from ftcc.sim.plant import UNITS

__all__ = ["DisturbanceFields", "FaultFields", "HomeFields", "NoiseFields", "ObstacleFields"]


class ObstacleFields(Strict):
    """A zone along the flight that UAVs must pass above."""

    x: tuple[float, float] = Field(description="m, forward positions of its beginning and end")
    top: float = Field(description="m, altitude of its top")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.x[0] < self.x[1]:
            raise ValueError(f"x = {list(self.x)}: must end behind where it begins")
        return self


class DisturbanceFields(Strict):
    """Disturbances of the plant from ``at`` to ``until``: constant, or oscillating at ``frequency``.

    An oscillating one is value * sin(frequency * (t - at) + phase). The onset is exponential, the end is a step.
    """

    at: float = Field(ge=0.0, description="s")
    until: float | None = Field(None, description="s, end, as a step; default: the disturbance is permanent")
    d1: float = Field(0.0, description="m/s^2, added to the rate of the airspeed")
    d2: float = Field(0.0, description="rad/s, added to the rate of the flight-path angle")
    d3: float = Field(0.0, description="rad/s^2, added to the pitch acceleration")
    b_x: float = Field(0.0, description="m/s^2, north")
    b_y: float = Field(0.0, description="m/s^2, east")
    b_z: float = Field(0.0, description="m/s^2, up")
    onset: float = Field(0.0, ge=0.0, description="1/s, rate of the exponential onset; 0 = step")
    frequency: float | None = Field(None, gt=0.0, description="rad/s, of an oscillation; default: constant")
    phase: float = Field(0.0, description="rad, phase of an oscillation at its beginning")
    uavs: list[Id] | None = Field(None, description="default: all followers")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_end(self.at, self.until)
        if self.frequency is None and "phase" in self.model_fields_set:
            raise ValueError("phase needs frequency, which makes an oscillation")
        return self

    @property
    def values(self) -> dict[str, float]:
        """The nonzero disturbances, by name."""
        given = {name: getattr(self, name) for name in ("d1", "d2", "d3", "b_x", "b_y", "b_z")}
        return {name: value for name, value in given.items() if value != 0.0}


class FaultFields(Strict):
    """A fault of an ``actuator`` or of the ``navigation`` solution, from ``at`` to its next fault or to ``until``.

    At ``until`` it is repaired, as by ``kind = "ok"``; another fault of the same part may begin only then.

    Actuators: wrong: effectiveness * position + bias; off: effectiveness 0; stuck: holds its deflection; slow: moves at
    ``slew`` at most; intermittent: healthy for a share of each period, else as wrong. Navigation: wrong: with an
    offset; off: dead reckoning, or attitude held and rates zero; stuck: held; slow: fresh once in a period;
    intermittent: fresh for a share of each period. ok: repaired.
    """

    at: float = Field(ge=0.0, description="s")
    until: float | None = Field(None, description="s, time of repair; default: the fault is permanent")
    uav: Id = Field(description="whose fault")
    actuator: Actuator | None = Field(None, description="which actuator fails, or")
    navigation: Literal["position", "attitude"] | None = Field(None, description="which part of the solution")
    kind: Literal["wrong", "off", "stuck", "slow", "intermittent", "ok"] = Field("wrong", description="see above")
    effectiveness: Probability = Field(1.0, description="share of the actuator's motion that is left")
    bias: float = Field(0.0, description="rad or N")
    effectiveness_onset: float = Field(0.0, ge=0.0, description="1/s, exponential; 0 = step")
    bias_onset: float = Field(0.0, ge=0.0, description="1/s, exponential; 0 = step")
    slew: float | None = Field(None, gt=0.0, description="rad/s or N/s, largest rate of a slow actuator")
    period: float | None = Field(None, gt=0.0, description="s, period of intermittent faults and of slow navigation")
    duty: Probability | None = Field(None, description="healthy share of the period")
    offset: tuple[float, float, float] = Field((0.0,) * 3, description="north, east, down, m; roll, pitch, yaw, rad")
    rate_offset: tuple[float, float, float] = Field((0.0,) * 3, description="north, east, down, m/s; p, q, r, rad/s")
    without_trim: bool = Field(False, description="true: fly even if the fault leaves no level trim")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.actuator is None) == (self.navigation is None):
            raise ValueError("needs either actuator or navigation")
        given = self.model_fields_set
        needed = {
            "slow": {"slew"} if self.actuator else {"period"},
            "intermittent": {"period", "duty"},
        }.get(self.kind, set())
        if needed - given:
            raise ValueError(f"kind = {self.kind!r} needs {', '.join(sorted(needed - given))}")
        lossy = {"effectiveness", "bias", "effectiveness_onset", "bias_onset"}
        sizes = {"wrong": lossy, "intermittent": lossy} if self.actuator else {"wrong": {"offset", "rate_offset"}}
        always = {"at", "uav", "actuator", "navigation", "kind", "without_trim"}
        if self.kind != "ok":
            always |= {"until"}
        check_end(self.at, self.until)
        extra = given - always - needed - sizes.get(self.kind, set())
        if extra:
            raise ValueError(f"kind = {self.kind!r} takes no {', '.join(sorted(extra))}")
        return self


class HomeFields(Strict):
    """Position of the local frame's origin on earth, for the maps of ground stations."""

    latitude: float = Field(47.3977, ge=-85.0, le=85.0, description="deg")
    longitude: float = Field(8.5456, ge=-180.0, le=180.0, description="deg")
    altitude: float = Field(0.0, ge=-500.0, le=9000.0, description="m above mean sea level at z = 0")
    datum: float = Field(
        0.0,
        ge=-500.0,
        le=20_000.0,
        description="m, altitude z from which the float32 of LOCAL_POSITION_NED counts between vehicle and autopilot",
    )


@extended({name: (float, Field(0.0, ge=0.0, description=unit)) for name, unit in UNITS.items()})
class NoiseFields(Strict):
    """White measurement noise: standard deviation of each channel at every sample.

    In the vertical plane either ``alpha`` or ``theta`` is given: the one follows from the other.
    """

    factor: float = Field(1.0, ge=0.0, description="factor on all standard deviations")

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviation by channel, times the factor."""
        return {name: float(getattr(self, name)) * self.factor for name in UNITS}
