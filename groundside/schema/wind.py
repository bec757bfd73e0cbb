"""The fields of moving air: mean wind, discrete gusts, turbulence."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from ftcc.groundside.schema.base import Id, NotNegative, Positive, Strict, check_end

__all__ = ["GustFields", "TurbulenceFields", "WindFields"]


class WindFields(Strict):
    """Wind and gust, eq. (9.33): along the track for plant "position", towards north for all others."""

    mean: float = Field(0.0, ge=0.0, description="m/s, V_m")
    gust: float = Field(0.0, ge=0.0, description="m/s, standard deviation of A, drawn for each UAV")
    gust_period: float = Field(0.1, ge=0.001, description="s, time for which a drawn value is held")


class GustFields(Strict):
    """A discrete 1-cosine gust: amplitude (1 - cos(pi x / length)) / 2 over the distance x flown since ``at``.

    It then stays constant, as in MIL-F-8785C (3.7.1.3), and from ``until`` on falls in the way it rose.
    ``held = false`` is the whole 1-cosine of CS-25.341, which falls at once; ``length`` is its gradient distance H.
    """

    at: float = Field(ge=0.0, description="s")
    until: float | None = Field(None, description="s, time from which it falls; default: it never falls")
    along: float = Field(0.0, description="m/s, amplitude along the track; tail wind > 0")
    right: float = Field(0.0, description="m/s, amplitude towards the right")
    up: float = Field(0.0, description="m/s, amplitude upwards")
    length: float = Field(gt=0.0, description="m, gust length d_m")
    held: bool = Field(True, description="false: it falls as soon as it has risen")
    airspeed: float | None = Field(None, gt=0.0, description="m/s, airspeed through it; default: the initial V")
    uavs: list[Id] | None = Field(None, min_length=1, description="default: all followers")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_end(self.at, self.until)
        if self.along == self.right == self.up == 0.0:
            raise ValueError("needs some of along, right, up")
        if self.until is not None and not self.held:
            raise ValueError("until needs a gust that is held")
        return self


class TurbulenceFields(Strict):
    """Continuous turbulence with the Dryden spectra of MIL-F-8785C (3.7.1.2), each UAV its own.

    Either ``sigma`` and ``length``; or the low-altitude model (3.7.3.4) of ``wind_20ft`` and ``altitude``.
    """

    sigma: tuple[NotNegative, NotNegative, NotNegative] | None = Field(
        None, description="m/s, standard deviations along the track, to the right, up"
    )
    length: tuple[Positive, Positive, Positive] | None = Field(None, description="m, scale lengths L_u, L_v, L_w")
    wind_20ft: float | None = Field(None, gt=0.0, description="m/s, wind at 20 ft above the ground")
    altitude: float | None = Field(
        None, ge=3.048, le=304.8, description="m above the ground, 10 to 1000 ft; the same for the whole flight"
    )
    turning: bool = Field(
        False, description="whether the air turns, too: p_g, q_g, r_g (3.7.5), by the airframe's span"
    )
    airspeed: float | None = Field(None, gt=0.0, description="m/s, airspeed through it; default: the initial V")
    uavs: list[Id] | None = Field(None, min_length=1, description="default: all followers")

    @model_validator(mode="after")
    def _one_way_of_saying(self) -> Self:
        explicit = (self.sigma is not None, self.length is not None)
        model = (self.wind_20ft is not None, self.altitude is not None)
        if any(explicit) == any(model) or any(explicit) != all(explicit) or any(model) != all(model):
            raise ValueError("needs either sigma and length, or wind_20ft and altitude")
        return self
