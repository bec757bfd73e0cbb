"""The fields of a study: what varies from flight to flight, and what is asked of each."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from ftcc.groundside.schema.base import Id, Strict

__all__ = ["StudyClaim", "StudyFields"]


class StudyClaim(Strict):
    """A bound that every flight of a study is held to."""

    name: str = Field(description="a sentence's beginning, for the report")
    metric: str = Field(description="how the signal becomes a number: a name of METRICS")
    signal: str = Field(description="arithmetic expression over columns of the recording")
    uavs: list[Id] | Literal["followers", "leaders", "all"] = Field("followers", description="whose signal")
    window: tuple[float, float] = Field(description="s, both ends included")
    threshold: float | None = Field(None, description="what some metrics need")
    unit: str = Field("", description="of the number")
    bound: str = Field(pattern=r"^\s*[<>]", description='"< 5" or "> 0.2"')

    @model_validator(mode="after")
    def _window_in_order(self) -> Self:
        if self.window[1] < self.window[0]:
            raise ValueError(f"window = {list(self.window)}: must not end before it begins")
        return self


class StudyFields(Strict):
    """What a study asks, and what it draws."""

    question: str = Field("", description="a sentence for the report")
    of: str | None = Field(
        None, description="the scenario, in a file that holds nothing else; name, or path from there"
    )
    form: str | None = Field(None, description="form of the law; default: the first one of the scenario")
    variants: list[str] = Field([], description="variants of the scenario")
    against: list[str] = Field([], description="variants with which every draw flies too, for comparison in pairs")
    changes: dict[str, Any] = Field({}, description="what the study changes in the scenario, merged like a variant")
    random: dict[str, Any] = Field(
        {}, description='distribution by key: faults.0.bias = { distribution = "uniform", low = -0.3, high = 0.3 }'
    )
    vary: dict[str, Any] = Field({}, description="list of values by key; every combination is flown")
    samples: int | None = Field(None, ge=1, description="number of draws; default: one")
    design: Literal["sobol", "lhs", "random"] = Field("sobol", description="how the draws fill their space")
    redraw: bool = Field(False, description="true: a draw that cannot fly is drawn again; false: it is a row")
    seed: int | None = Field(None, ge=0, description="of the draws and the first flight; default: the scenario's")
    claims: list[StudyClaim] = Field(
        [], description="what every flight is held to; default: the claims of the scenario's case"
    )
