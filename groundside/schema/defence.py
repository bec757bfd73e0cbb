"""The fields of the defences against neighbours that share what is not so."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from ftcc.groundside.schema.base import Id

__all__ = ["DefenceFields"]


class DefenceFields(BaseModel):
    """What followers leave of what their neighbours tell; every other key is a setting, see [gains](gains.md#defence).

    A table that is there, be all its settings 0, makes the settings parameters that can be changed in flight.
    """

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, float]

    trusted: list[Id | Literal["leaders"]] = Field(
        [], description='ids of those who are trusted whatever they tell; "leaders" stands for all leaders'
    )

    @property
    def given(self) -> dict[str, float]:
        """The settings that the file gives."""
        return dict(self.__pydantic_extra__)
