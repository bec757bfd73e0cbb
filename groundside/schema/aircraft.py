"""The fields of airframe sheets, and of a scenario's aircraft: limits, lags, guards, initial states."""

from __future__ import annotations

import math
from typing import Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ftcc.groundside.schema.base import Actuator, Id, Positive, Strict, extended
from ftcc.link.airframe import Airframe, PointMass, parameters

__all__ = ["AirframeSheet", "Damping", "Lag", "Plant", "PointMassSheet", "RateLimits", "Start", "Starts", "record_of"]


Record = TypeVar("Record", Airframe, PointMass)


def _fields_for(record: Any) -> dict[str, Any]:
    """Return a sheet's field for each parameter of a record of `ftcc.link.airframe`."""
    return {
        name: (
            float,
            Field(
                gt=parameter.above if math.isfinite(parameter.above) else None,
                ge=parameter.least if math.isfinite(parameter.least) else None,
                description=f"{parameter.unit}, {parameter.meaning}",
            ),
        )
        for name, parameter in parameters(record).items()
    }


def record_of(sheet: BaseModel, record: type[Record]) -> Record:
    """Return a sheet's parameters as a record of `ftcc.link.airframe`."""
    return record(**{name: float(getattr(sheet, name)) for name in record._fields})


@extended(_fields_for(Airframe))
class AirframeSheet(Strict):
    """An airframe's coefficients: the fields of `Airframe`, by name."""

    title: str = ""
    T_max: Positive = Field(description="N, full thrust of the engine, eq. (2.6)")


@extended(_fields_for(PointMass))
class PointMassSheet(Strict):
    """An aircraft as a point: the fields of `PointMass`, by name."""

    title: str = ""
    T_max: Positive = Field(description="N, full thrust of the engine")


class Lag(Strict):
    """Bandwidth of each actuator's first-order lag, rad/s; 0: no lag."""

    thrust: float = Field(0.0, ge=0.0)
    elevator: float = Field(0.0, ge=0.0)
    aileron: float = Field(0.0, ge=0.0)
    rudder: float = Field(0.0, ge=0.0)
    load_factor: float = Field(0.0, ge=0.0)
    bank: float = Field(0.0, ge=0.0)


class RateLimits(Strict):
    """Rate limit of each actuator, N/s, rad/s or 1/s; inf, the default: no limit."""

    model_config = ConfigDict(allow_inf_nan=True)

    thrust: Positive = math.inf
    elevator: Positive = math.inf
    aileron: Positive = math.inf
    rudder: Positive = math.inf
    load_factor: Positive = math.inf
    bank: Positive = math.inf


class Damping(Strict):
    """Damping ratio of second-order actuators, whose ``lag`` is the natural frequency; 0: first order."""

    thrust: float = Field(0.0, ge=0.0, lt=1.0)
    elevator: float = Field(0.0, ge=0.0, lt=1.0)
    aileron: float = Field(0.0, ge=0.0, lt=1.0)
    rudder: float = Field(0.0, ge=0.0, lt=1.0)
    load_factor: float = Field(0.0, ge=0.0, lt=1.0)
    bank: float = Field(0.0, ge=0.0, lt=1.0)


class Limits(Strict):
    """Travel of each actuator: [lowest, highest], N, rad or load factor."""

    thrust: tuple[float, float] | None = None
    elevator: tuple[float, float] | None = None
    aileron: tuple[float, float] | None = None
    rudder: tuple[float, float] | None = None
    load_factor: tuple[float, float] | None = None
    bank: tuple[float, float] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name in type(self).model_fields:
            pair = getattr(self, name)
            if pair is not None and not pair[0] < pair[1]:
                raise ValueError(f"{name} = {list(pair)}: the lower limit must be below the upper one")
        return self


class Guards(Strict):
    """Limits of the model's valid range: an aircraft beyond them counts as lost."""

    least_airspeed: float = Field(3.0, gt=0.0, description="m/s")
    flight_path_angle: float = Field(1.5, gt=0.0, lt=1.5708, description="rad")
    angle_of_attack: float = Field(1.5, gt=0.0, lt=1.5708, description="rad")
    sideslip: float = Field(1.4, gt=0.0, lt=1.5708, description="rad")


class AutothrottleFields(Strict):
    """The vehicle's own speed hold, which replaces the commanded thrust: thrust + gain (airspeed - V)."""

    airspeed: float = Field(gt=0.0, description="m/s")
    gain: float = Field(gt=0.0, description="N per m/s")
    thrust: float = Field(ge=0.0, description="N")


class Plant(Strict):
    """Options of the true aircraft."""

    model: str | None = Field(
        None, description="name of the plant; default: the plant of the scheme; jsbsim: an aircraft of JSBSim flies"
    )
    aircraft: str | None = Field(
        None, description="for model = jsbsim: an aircraft of the package jsbsim by name, or an XML file"
    )
    properties: dict[str, float] = Field(
        {}, description="for model = jsbsim: JSBSim's properties that are set before the flight, by name"
    )
    coefficients: dict[str, float] = Field(
        {}, description="factor on each true aerodynamic coefficient, by name; the laws' nominal model stays"
    )
    elevator_lift: bool = Field(True, description="false: CLde = 0")
    lag: Lag = Lag()
    damping: Damping = Damping()
    delay: int = Field(0, ge=0, le=10, description="samples, additional delay of a command")
    limits: Limits
    rate_limits: RateLimits = RateLimits()
    autothrottle: AutothrottleFields | None = None
    fault: Literal["after_lag", "before_lag"] = Field("after_lag", description="where faults of actuators act")
    initial_actuators: Literal["trim"] | dict[Actuator, float] = Field(
        "trim",
        description="N, rad: position, and command before the first one arrives. With trim and a delay, the first "
        "command also replaces all earlier ones; between processes it arrives one sample after t = 0",
    )
    guards: Guards = Guards()
    beyond_limits: bool = Field(False, description="true: fly even if a healthy aircraft has no level trim")


class Start(Strict):
    """State at t = 0."""

    V: float | None = Field(None, gt=0.0, description="m/s, airspeed")
    x: float | None = Field(None, description="m, forward position")
    y: float | None = Field(None, description="m, lateral position; constant in the vertical plane")
    z: float | None = Field(None, description="m, altitude")
    gamma: float | None = Field(None, gt=-1.5, lt=1.5, description="rad, flight-path angle")
    theta: float | Literal["trim"] | None = Field(None, description="rad, pitch angle")
    q: float | None = Field(None, description="rad/s, pitch rate")
    chi: float | None = Field(None, description="rad, course")
    mu: float | None = Field(None, description="rad, bank about the velocity")
    alpha: float | None = Field(None, gt=-1.5, lt=1.5, description="rad, angle of attack")
    beta: float | None = Field(None, gt=-1.4, lt=1.4, description="rad, sideslip")
    p: float | None = Field(None, description="rad/s, roll rate")
    r: float | None = Field(None, description="rad/s, yaw rate")


class Starts(Start):
    """State of the followers at t = 0, with exceptions by UAV."""

    uav: dict[Id, Start] = {}
