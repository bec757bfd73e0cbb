"""The fields of a whole scenario, and of its claims."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, model_validator

from ftcc.groundside.schema.aircraft import Plant, Starts
from ftcc.groundside.schema.attacks import AttackFields, NetworkFields
from ftcc.groundside.schema.base import Id, Strict
from ftcc.groundside.schema.defence import DefenceFields
from ftcc.groundside.schema.diagnosis import DiagnosisFields
from ftcc.groundside.schema.fire import FireEventFields, FireFields
from ftcc.groundside.schema.network import ChannelFields, GraphFields, LinkEventFields
from ftcc.groundside.schema.references import AttitudeFields, LeaderFields
from ftcc.groundside.schema.study import StudyFields
from ftcc.groundside.schema.wind import GustFields, TurbulenceFields, WindFields
from ftcc.groundside.schema.world import DisturbanceFields, FaultFields, HomeFields, NoiseFields, ObstacleFields

__all__ = ["Claim", "Plan", "Rates", "fields_of"]


class Uavs(Strict):
    """Ids of the UAVs."""

    followers: list[Id] = Field(min_length=1, description="they fly the scheme")
    leaders: list[Id] = Field([], description="reference points; their ids follow those of the followers")


class Rates(Strict):
    """The time grid. Ideal exchange (form "monograph") has neither an exchange period nor a latency."""

    control_rate: float = Field(gt=0.0, le=2000.0, description="Hz; the period is whole microseconds")
    exchange_rate: float | None = Field(None, gt=0.0, le=2000.0, description="Hz, rate of records to the neighbours")
    latency: float | None = Field(None, ge=0.0, description="s, link latency; default: one exchange period")
    plant_step: float = Field(0.001, gt=0.0, le=0.01, description="s, integration step of the plant")


class GainFields(BaseModel):
    """Gains of the scheme by name, with exceptions by UAV."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, float]

    uav: dict[Id, dict[str, float]] = Field({}, description="gains of single UAVs, by name")

    @property
    def common(self) -> dict[str, float]:
        """Gains of all UAVs that the file gives."""
        return dict(self.__pydantic_extra__)


class MissionFields(Strict):
    """Values that every follower knows from the start."""

    V: float = Field(gt=0.0, description="m/s, the mission's speed")


class Claim(Strict):
    """A number that a flight must show. ``expected`` has a value per case; a case that is missing has no such claim."""

    name: str = Field(description="a sentence's beginning, for the report")
    metric: str = Field(description="how the signal becomes a number: a name of METRICS")
    signal: str = Field(description="arithmetic expression over columns of the recording")
    uavs: list[Id] | Literal["followers", "leaders", "all"] = Field("followers", description="whose signal")
    window: tuple[float, float] = Field(description="s, both ends included")
    within: list[tuple[float, float]] = Field([], description="s, evaluated parts of the window; default: all of it")
    threshold: float | dict[str, float] | None = Field(None, description="a number, or one per case")
    unit: str = Field("", description="of the number")
    source: str = Field(description="where the expected number comes from")
    expected: dict[str, float | list[float]] = Field(description="by case: a number, or one per UAV")
    tolerance: str | dict[str, str] = Field(
        description='"15 %", "0.02", "10 % or 0.01", "< 0.05", "> 2" or "< 1.5 x"; one text, or by case'
    )

    @model_validator(mode="after")
    def _window_in_order(self) -> Self:
        if self.window[1] < self.window[0]:
            raise ValueError(f"window = {list(self.window)}: must not end before it begins")
        for part in self.within:
            if not self.window[0] <= part[0] <= part[1] <= self.window[1]:
                raise ValueError(f"within = {list(part)}: must be a part of window = {list(self.window)}")
        return self


class FlownRun(Strict):
    """The run that recorded the scenario."""

    started: AwareDatetime = Field(description="date and time of simulated time 0 in exported tracks and logs")


class Flown(Strict):
    """Origin of a scenario in a run's folder."""

    name: str = Field(description="name or file of the scenario")
    form: str = Field(description="form of the law")
    variants: list[str] = Field([], description="variants that were flown")
    settings: list[str] = Field([], description="what --set changed")
    versions: dict[str, str] = Field({}, description="of the program and of its libraries")
    run: FlownRun | None = None


class Plan(Strict):
    """A scenario after its form, variants and settings have been merged."""

    title: str = Field(description="what it flies, for lists and reports")
    scheme: str = Field(description="the control law: a name of `ftcc list`")
    airframe: str = Field("reference_25kg", description="a bundled sheet, or the path of a TOML file")
    duration: float = Field(gt=0.0, le=1e5, description="s")
    seed: int = Field(1, ge=0, lt=2**63, description="of losses, jitter, noise, gusts and turbulence")
    record_rate: float = Field(100.0, gt=0.0, le=2000.0, description="Hz")
    uavs: Uavs
    rates: Rates
    graph: GraphFields
    channel: ChannelFields = ChannelFields()
    plant: Plant
    start: Starts
    mission: MissionFields | None = None
    attitude: AttitudeFields | None = None
    fire: FireFields | None = None
    fire_events: list[FireEventFields] = []
    wind: WindFields | None = None
    gusts: list[GustFields] = []
    turbulence: TurbulenceFields | None = None
    leaders: dict[Id, LeaderFields] = {}
    obstacles: list[ObstacleFields] = []
    detection_range: float | None = Field(None, gt=0.0, description="m, range at which leaders detect an obstacle")
    gains: GainFields = GainFields()
    switches: dict[str, bool] = Field({}, description="false takes a part out of the law: fault_tolerance")
    diagnosis: DiagnosisFields = DiagnosisFields()
    defence: DefenceFields | None = None
    disturbances: list[DisturbanceFields] = []
    faults: list[FaultFields] = []
    link_events: list[LinkEventFields] = []
    attacks: list[AttackFields] = []
    network: NetworkFields = NetworkFields()
    noise: NoiseFields = NoiseFields()
    home: HomeFields = HomeFields()
    claims: list[Claim] = []
    study: StudyFields | None = Field(None, description="for `ftcc study` alone; flights do not depend on it")
    flown: Flown | None = None


def fields_of(model: Any) -> list[str]:
    """Return the names of a model's fields as they are written in a file."""
    return [field.alias or name for name, field in model.model_fields.items()]
