"""What may stand in a scenario and in an airframe sheet: every field with its unit and range.

`scenario` reads the files and merges forms and variants; `mission` turns the result into what the processes are told.
"""

from __future__ import annotations

import math
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ftcc.groundside.schema_base import Id, NotNegative, Positive, Probability, Strict
from ftcc.groundside.schema_fire import FireEventFields, FireFields, WindFields

__all__ = ["AirframeSheet", "ChannelFields", "Claim", "LeaderFields", "LinkEventFields", "Plan", "Start", "fields_of"]

Actuator = Literal["thrust", "elevator", "aileron", "rudder", "load_factor", "bank"]


class AirframeSheet(Strict):
    """An airframe's coefficients (SI units, rad); the names are those of the monograph's (2.1)-(2.7)."""

    title: str = ""
    m: Positive
    g: Positive
    rho: Positive
    S: Positive
    c: Positive
    b: Positive
    Ix: Positive
    Iy: Positive
    Iz: Positive
    Ixz: float
    T_max: Positive
    CL0: float
    CLa: Positive
    CLde: float
    CD0: NotNegative
    CDa: float
    CDa2: float
    Cm0: float
    Cma: float
    Cmde: float
    Cmq: float
    CY0: float
    CYb: float
    Cl0: float
    Clb: float
    Clda: float
    Cldr: float
    Clp: float
    Clr: float
    Cn0: float
    Cnb: float
    Cnda: float
    Cndr: float
    Cnp: float
    Cnr: float


class Uavs(Strict):
    """Who flies: ids, leaders after followers."""

    followers: list[Id] = Field(min_length=1)
    leaders: list[Id] = []


class Rates(Strict):
    """The time grid. Ideal exchange (form "monograph") has no exchange period and no latency of its own."""

    control_rate: float = Field(gt=0.0, le=2000.0, description="Hz")
    exchange_rate: float | None = Field(None, gt=0.0, le=2000.0, description="Hz, records to the neighbours")
    latency: float | None = Field(None, ge=0.0, description="s, link latency; default: one exchange period")
    plant_step: float = Field(0.001, gt=0.0, le=0.01, description="s, integration step of the plant")


class EdgeFields(Strict):
    """An edge of the communication graph: ``between`` two UAVs (both ways), or ``from`` a sender ``to`` a receiver."""

    between: tuple[int, int] | None = None
    sender: int | None = Field(None, alias="from")
    receiver: int | None = Field(None, alias="to")
    weight: float = Field(gt=0.0, description="a_ij of the monograph")

    @model_validator(mode="after")
    def _one_way_of_saying(self) -> Self:
        both = self.between is not None
        directed = (self.sender is not None, self.receiver is not None)
        if both == any(directed) or any(directed) != all(directed):
            raise ValueError("needs either between = [a, b], or from = a and to = b")
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
    burst_start: Probability = Field(0.0, description="probability per record of entering a burst")
    burst_end: Probability = Field(1.0, description="probability per record of leaving it")
    burst_loss: Probability = Field(1.0, description="probability of loss within a burst")
    delay: float = Field(0.0, ge=0.0, description="s, beyond the link latency")
    jitter: float = Field(0.0, ge=0.0, description="s, further delay, uniform in [0, jitter]")


class LinkEventFields(Strict):
    """A change of the radio of one UAV, or of one edge, from ``at`` to ``until``."""

    at: float = Field(ge=0.0, description="s")
    until: float | None = Field(None, description="s; without it the change is for good")
    kind: Literal["cut", "degrade"]
    uav: Id | None = None
    edge: tuple[Id, Id] | None = Field(None, description="[sender, receiver]")
    directed: bool = Field(False, description="only sender -> receiver")
    loss: Probability | None = None
    burst_start: Probability | None = None
    burst_end: Probability | None = None
    burst_loss: Probability | None = None
    delay: float | None = Field(None, ge=0.0, description="s")
    jitter: float | None = Field(None, ge=0.0, description="s")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.uav is None) == (self.edge is None):
            raise ValueError("needs either uav = n or edge = [sender, receiver]")
        if self.until is not None and self.until <= self.at:
            raise ValueError(f"until = {self.until:g} must be later than at = {self.at:g}")
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


class Lag(Strict):
    """First-order lag of each actuator, rad/s; 0 = none."""

    thrust: float = Field(0.0, ge=0.0)
    elevator: float = Field(0.0, ge=0.0)
    aileron: float = Field(0.0, ge=0.0)
    rudder: float = Field(0.0, ge=0.0)
    load_factor: float = Field(0.0, ge=0.0)
    bank: float = Field(0.0, ge=0.0)


class RateLimits(Strict):
    """Fastest motion of each actuator, N/s, rad/s and 1/s; inf, the default: no limit."""

    model_config = ConfigDict(allow_inf_nan=True)

    thrust: Positive = math.inf
    elevator: Positive = math.inf
    aileron: Positive = math.inf
    rudder: Positive = math.inf
    load_factor: Positive = math.inf
    bank: Positive = math.inf


class Damping(Strict):
    """Of actuators of second order, whose ``lag`` is their natural frequency; 0: first order."""

    thrust: float = Field(0.0, ge=0.0, lt=1.0)
    elevator: float = Field(0.0, ge=0.0, lt=1.0)
    aileron: float = Field(0.0, ge=0.0, lt=1.0)
    rudder: float = Field(0.0, ge=0.0, lt=1.0)
    load_factor: float = Field(0.0, ge=0.0, lt=1.0)
    bank: float = Field(0.0, ge=0.0, lt=1.0)


class Limits(Strict):
    """Travel of each actuator: [lowest, highest], N, rad, and load factor."""

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
    """Where the model ends: beyond these an aircraft counts as lost."""

    least_airspeed: float = Field(3.0, gt=0.0, description="m/s")
    flight_path_angle: float = Field(1.5, gt=0.0, lt=1.5708, description="rad")
    angle_of_attack: float = Field(1.5, gt=0.0, lt=1.5708, description="rad")
    sideslip: float = Field(1.4, gt=0.0, lt=1.5708, description="rad")


class AutothrottleFields(Strict):
    """The vehicle's own speed hold, in place of the commanded thrust: thrust + gain (airspeed - V)."""

    airspeed: float = Field(gt=0.0, description="m/s")
    gain: float = Field(gt=0.0, description="N per m/s")
    thrust: float = Field(ge=0.0, description="N")


class Plant(Strict):
    """Options of the true aircraft."""

    model: str | None = Field(None, description="which plant flies; default: the one that the scheme is made for")
    coefficients: dict[str, float] = Field(
        {}, description="factors of the true aircraft's aerodynamic coefficients, of which laws know nothing, by name"
    )
    elevator_lift: bool = Field(True, description="false: CLde = 0")
    lag: Lag = Lag()
    damping: Damping = Damping()
    delay: int = Field(0, ge=0, le=10, description="samples by which a command acts later than it has to")
    limits: Limits
    rate_limits: RateLimits = RateLimits()
    autothrottle: AutothrottleFields | None = None
    fault: Literal["after_lag", "before_lag"] = "after_lag"
    initial_actuators: Literal["trim"] | dict[Actuator, float] = Field(
        "trim",
        description="position, and command in force before the first one has come through; N, rad. With trim and a "
        "delay the first command counts as all that came before it",
    )
    guards: Guards = Guards()


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
    """State of the followers at t = 0, and where single UAVs differ."""

    uav: dict[Id, Start] = {}


class GainFields(BaseModel):
    """Gains of the scheme by name, and where single UAVs differ."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, float]

    uav: dict[Id, dict[str, float]] = {}

    @property
    def common(self) -> dict[str, float]:
        """Those of all UAVs, as far as the file gives them."""
        return dict(self.__pydantic_extra__)


class MissionFields(Strict):
    """What every follower knows without being told."""

    V: float = Field(gt=0.0, description="m/s, the mission's speed")


class Filter(Strict):
    """Second-order filter."""

    frequency: float = Field(gt=0.0, description="rad/s")
    damping: float = Field(gt=0.0)


class CommandFields(Strict):
    """From ``at`` on, or once leader ``uav`` has passed ``x``: another altitude, another speed."""

    at: float | None = Field(None, ge=0.0, description="s")
    uav: Id | None = None
    x: float | None = Field(None, description="m, forward position")
    altitude: float | None = Field(None, description="m; default: as before")
    speed: float | None = Field(None, gt=0.0, description="m/s; default: as before")

    @model_validator(mode="after")
    def _by_time_or_position(self) -> Self:
        if (self.at is None) == (self.x is None):
            raise ValueError("needs either at = seconds, or x = position (and uav = the leader that passes it)")
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
        description="m, altitude at which to pass each obstacle, from its detection until all leaders are past it; "
        "elsewhere that of the start",
    )
    forward: bool = Field(False, description="speeds are forward speeds instead of airspeeds")
    climb_limit: float | None = Field(
        None, gt=0.0, description="m/s, largest climb rate of the profile; default: what the followers can follow"
    )
    sink_limit: float | None = Field(None, gt=0.0, description="m/s, largest sink rate; default likewise")


class AttitudeCommandFields(Strict):
    """From ``at`` on: another commanded attitude with respect to the velocity; what is not given stays."""

    at: float = Field(ge=0.0, description="s")
    bank: float | None = Field(None, gt=-1.5, lt=1.5, description="rad")
    alpha: float | None = Field(None, gt=-1.5, lt=1.5, description="rad, angle of attack")
    sideslip: float | None = Field(None, gt=-1.5, lt=1.5, description="rad")
    uavs: list[Id] | None = Field(None, min_length=1, description="default: all followers")

    @model_validator(mode="after")
    def _commands_something(self) -> Self:
        if self.bank is None and self.alpha is None and self.sideslip is None:
            raise ValueError("needs some of bank, alpha, sideslip")
        return self


class AttitudeFields(Strict):
    """The attitude that each UAV refers to by itself: commands through a second-order filter."""

    filter: Filter = Filter(frequency=0.9, damping=0.3)
    commands: list[AttitudeCommandFields] = Field(min_length=1)


class ObstacleFields(Strict):
    """A zone along the flight that is to be passed above."""

    x: tuple[float, float] = Field(description="m, from and to this forward position")
    top: float = Field(description="m, altitude")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.x[0] < self.x[1]:
            raise ValueError(f"x = {list(self.x)}: must end behind where it begins")
        return self


class DisturbanceFields(Strict):
    """Constant disturbances from ``at`` on, as far as the plant has them."""

    at: float = Field(ge=0.0, description="s")
    d1: float = Field(0.0, description="m/s^2, of the airspeed")
    d2: float = Field(0.0, description="rad/s, of the flight-path angle")
    d3: float = Field(0.0, description="rad/s^2, of the pitch rate")
    b_x: float = Field(0.0, description="m/s^2, north")
    b_y: float = Field(0.0, description="m/s^2, east")
    b_z: float = Field(0.0, description="m/s^2, up")
    onset: float = Field(0.0, ge=0.0, description="1/s, rate of the exponential onset; 0 = step")
    uavs: list[Id] | None = Field(None, description="default: all followers")

    @property
    def values(self) -> dict[str, float]:
        """The disturbances that are not zero, by name."""
        given = {name: getattr(self, name) for name in type(self).model_fields if name not in ("at", "onset", "uavs")}
        return {name: value for name, value in given.items() if value != 0.0}


class FaultFields(Strict):
    """From ``at`` on an ``actuator``, or the ``navigation`` solution, fails, until another fault of it.

    Actuators: wrong: effectiveness * position + bias; off: effectiveness 0; stuck: holds its deflection; slow: moves at
    ``slew`` at most; intermittent: healthy for a share of each period, else as wrong. Navigation: wrong: with an
    offset; off: dead reckoning, or attitude held and rates zero; stuck: held; slow: fresh once in a period;
    intermittent: fresh for a share of each period. ok: repaired.
    """

    at: float = Field(ge=0.0, description="s")
    uav: Id
    actuator: Actuator | None = None
    navigation: Literal["position", "attitude"] | None = None
    kind: Literal["wrong", "off", "stuck", "slow", "intermittent", "ok"] = "wrong"
    effectiveness: Probability = 1.0
    bias: float = Field(0.0, description="rad or N")
    effectiveness_onset: float = Field(0.0, ge=0.0, description="1/s, exponential; 0 = step")
    bias_onset: float = Field(0.0, ge=0.0, description="1/s, exponential; 0 = step")
    slew: float | None = Field(None, gt=0.0, description="rad/s or N/s, largest rate of a slow actuator")
    period: float | None = Field(None, gt=0.0, description="s, of intermittent faults and of slow navigation")
    duty: Probability | None = Field(None, description="healthy share of the period")
    offset: tuple[float, float, float] = Field((0.0,) * 3, description="north, east, down, m; roll, pitch, yaw, rad")
    rate_offset: tuple[float, float, float] = Field((0.0,) * 3, description="north, east, down, m/s; p, q, r, rad/s")
    without_trim: bool = Field(False, description="true: fly it although it leaves no level trim")

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
        extra = given - always - needed - sizes.get(self.kind, set())
        if extra:
            raise ValueError(f"kind = {self.kind!r} takes no {', '.join(sorted(extra))}")
        return self


class HomeFields(Strict):
    """Where on earth the origin of the local frame lies, for the maps of ground stations."""

    latitude: float = Field(47.3977, ge=-85.0, le=85.0, description="deg")
    longitude: float = Field(8.5456, ge=-180.0, le=180.0, description="deg")
    altitude: float = Field(0.0, ge=-500.0, le=9000.0, description="m above mean sea level at z = 0")


class NoiseFields(Strict):
    """White measurement noise: standard deviation of each channel at every sample."""

    factor: float = Field(1.0, ge=0.0, description="multiplies all of them")
    x: float = Field(0.0, ge=0.0, description="m")
    y: float = Field(0.0, ge=0.0, description="m")
    z: float = Field(0.0, ge=0.0, description="m")
    V: float = Field(0.0, ge=0.0, description="m/s")
    gamma: float = Field(0.0, ge=0.0, description="rad")
    chi: float = Field(0.0, ge=0.0, description="rad")
    mu: float = Field(0.0, ge=0.0, description="rad")
    alpha: float = Field(0.0, ge=0.0, description="rad; in the vertical plane either this or theta")
    beta: float = Field(0.0, ge=0.0, description="rad")
    theta: float = Field(0.0, ge=0.0, description="rad")
    p: float = Field(0.0, ge=0.0, description="rad/s")
    q: float = Field(0.0, ge=0.0, description="rad/s")
    r: float = Field(0.0, ge=0.0, description="rad/s")


class Claim(Strict):
    """A number that a flight must show. ``expected`` is keyed by case; a case that is not listed has no such claim."""

    name: str
    metric: str
    signal: str = Field(description="arithmetic expression over columns of the recording")
    uavs: list[Id] | Literal["followers", "leaders", "all"] = "followers"
    window: tuple[float, float] = Field(description="s, both ends included")
    within: list[tuple[float, float]] = Field([], description="s, parts of the window that alone count; default: all")
    threshold: float | dict[str, float] | None = Field(None, description="for the metrics that need one; by case")
    unit: str = ""
    source: str
    expected: dict[str, float | list[float]]
    tolerance: str | dict[str, str] = Field(
        description='"15 %", "0.02", "10 % or 0.01", "< 0.05", "> 2" or "< 1.5 x"; by case'
    )

    @model_validator(mode="after")
    def _window_in_order(self) -> Self:
        if self.window[1] < self.window[0]:
            raise ValueError(f"window = {list(self.window)}: must not end before it begins")
        for part in self.within:
            if not self.window[0] <= part[0] <= part[1] <= self.window[1]:
                raise ValueError(f"within = {list(part)}: must be a part of window = {list(self.window)}")
        return self


class Flown(Strict):
    """How a scenario that a run recorded came about."""

    name: str
    form: str
    variants: list[str] = []
    settings: list[str] = []
    versions: dict[str, str] = {}


class Plan(Strict):
    """A scenario after its form, variants and settings have been merged."""

    title: str
    scheme: str
    airframe: str = "reference_25kg"
    duration: float = Field(gt=0.0, le=1e5, description="s")
    seed: int = Field(1, ge=0, lt=2**63)
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
    leaders: dict[Id, LeaderFields] = {}
    obstacles: list[ObstacleFields] = []
    detection_range: float | None = Field(None, gt=0.0, description="m, at which the leaders detect an obstacle ahead")
    gains: GainFields = GainFields()
    switches: dict[str, bool] = {}
    disturbances: list[DisturbanceFields] = []
    faults: list[FaultFields] = []
    link_events: list[LinkEventFields] = []
    noise: NoiseFields = NoiseFields()
    home: HomeFields = HomeFields()
    claims: list[Claim] = []
    flown: Flown | None = None


def fields_of(model: Any) -> list[str]:
    """Names of the fields of a model as they stand in a file."""
    return [field.alias or name for name, field in model.model_fields.items()]
