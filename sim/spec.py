"""The specification of a vehicle, which its process gets at the start: plain, frozen, checked before."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ftcc.link.actuators import ACTUATORS
from ftcc.link.attitude_target import UNCODED, AttitudeCode
from ftcc.link.messages import PositionTarget
from ftcc.sim.actuation import NO_AUTOTHROTTLE, Autothrottle
from ftcc.sim.disturbances import CALM, Disturbance, Gust
from ftcc.sim.faults import Fault
from ftcc.sim.jsbsim.flight import FlownAircraft
from ftcc.sim.navigation import NavigationFault
from ftcc.sim.obstacles import Obstacle
from ftcc.sim.plant import TRUTH, Guards
from ftcc.sim.plants import find
from ftcc.sim.wind import NO_TURBULENCE, DiscreteGust, Turbulence

__all__ = ["VehicleSpec", "placeholder"]


@dataclass(frozen=True)
class VehicleSpec:
    """A vehicle."""

    uav: int
    kind: str
    """"aircraft", or "reference_point": the kinematic stand-in for a leader's aircraft."""
    plant: str
    """Name of the plant of all aircraft of the swarm, see `plants`."""
    airframe: tuple[float, ...]
    """The plant's ``Parameters``."""
    initial: tuple[float, ...]
    """The plant's ``State``."""
    command: tuple[float, ...]
    """Command in force, and position of the actuators, before the first one arrives; order of ``ACTUATORS``, rad, N."""
    limits: tuple[tuple[float, float], ...]
    """Lower and upper limit of each actuator's command, rad or N."""
    lag: tuple[float, ...]
    """Bandwidth of each actuator, rad/s; 0 = no lag."""
    rate: tuple[float, ...]
    """Rate limit of each actuator, rad/s or N/s; inf = none."""
    fault_before_lag: bool
    """Whether a fault acts at the input of the lag instead of on the position behind it."""
    faults: tuple[Fault, ...]
    disturbances: tuple[Disturbance, ...]
    noise: tuple[float, ...]
    """Standard deviation of each channel of ``TRUTH`` as measured."""
    guards: Guards
    offset: float
    """Lateral position at the start, m."""
    autothrottle: Autothrottle = NO_AUTOTHROTTLE
    damping: tuple[float, ...] = (0.0,) * len(ACTUATORS)
    """Of second-order actuators, below 1; 0 = first order."""
    delay: int = 0
    """Samples by which a command acts later than it has to."""
    holds_first: bool = False
    """Whether ``command`` stays in force for that delay; otherwise the first command received is in force at once."""
    gust: Gust = CALM
    discrete_gusts: tuple[DiscreteGust, ...] = ()
    turbulence: Turbulence = NO_TURBULENCE
    attitude_code: AttitudeCode = UNCODED
    """Whether and how commands come as attitude targets."""
    target: tuple[float, ...] = (0.0,) * len(PositionTarget._fields)
    """A `reference_point`'s first target, see ``messages.PositionTarget``."""
    navigation_faults: tuple[NavigationFault, ...] = ()
    datum: float = 0.0
    """Altitude from which that in the state message counts, m."""
    obstacles: tuple[Obstacle, ...] = ()
    """The same for all vehicles."""
    flown: FlownAircraft | None = None
    """The aircraft of JSBSim that flies, where the plant flies one."""

    @property
    def travel(self) -> tuple[float, ...]:
        """Full deflection of each actuator, by which commands are divided on the wire."""
        return tuple(max(abs(low), abs(high)) for low, high in self.limits)


def placeholder(plant: str) -> VehicleSpec:
    """A vehicle that is never flown, to compile with."""
    flown = find(plant)
    return VehicleSpec(
        uav=1,
        kind="aircraft",
        plant=plant,
        airframe=(1.0,) * len(flown.Parameters._fields),
        initial=(1.0,) * len(flown.State._fields),
        command=(0.0,) * len(ACTUATORS),
        limits=((0.0, 0.0),) * len(ACTUATORS),
        lag=(0.0,) * len(ACTUATORS),
        rate=(math.inf,) * len(ACTUATORS),
        fault_before_lag=False,
        faults=(),
        disturbances=(),
        noise=(0.0,) * len(TRUTH),
        guards=Guards(*(0.0,) * len(Guards._fields)),
        offset=0.0,
    )
