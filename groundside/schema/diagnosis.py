"""The fields of active fault tolerance."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from ftcc.groundside.schema.base import Strict

__all__ = ["DiagnosisFields"]


class SettingFields(BaseModel):
    """Settings of diagnosis by name, see ``airside.diagnosis.gains``."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, float]

    @property
    def given(self) -> dict[str, float]:
        """Those that the file gives."""
        return dict(self.__pydantic_extra__)


class DiagnosisFields(Strict):
    """Whether every follower diagnoses its own actuators, and what follows from it."""

    on: bool = Field(False, description="true: followers detect, isolate and estimate faults of their actuators")
    accommodate: bool = Field(False, description="true: the own law is told of known faults")
    cooperate: bool = Field(False, description="true: the swarm makes room for a UAV that can do less")
    gains: SettingFields = SettingFields()
