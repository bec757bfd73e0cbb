"""An aircraft of JSBSim under our inner loop: it takes thrust, load factor and bank as demands, as plant `guided`.

The loop (`ftcc.sim.inner_loop`) knows the nominal model alone, the scenario's airframe sheet. Its surfaces have a lag
and a rate limit, in front of the flight controls that JSBSim gives the aircraft.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ftcc.link.compiled import compiled
from ftcc.sim.airframe import Airframe, attitude_rates
from ftcc.sim.inner_loop import LoopState, deflections, load_factor, loop_rates, pace_of
from ftcc.sim.jsbsim.flight import Driven, FlownAircraft
from ftcc.sim.jsbsim.steady import steady_flight
from ftcc.sim.plants import jsbsim
from ftcc.sim.plants.guided import State, surface_rate
from ftcc.sim.plants.jsbsim import DISTURBANCES, Disturbances, airspeed, complete, lost, truth, wind_of
from ftcc.sim.plants.position import ACTUATORS, COMPLETED, Inputs
from ftcc.sim.wind import against

__all__ = [
    "ACTUATORS",
    "BY_ATTITUDE",
    "COMPLETED",
    "DISTURBANCES",
    "SERVES",
    "START",
    "Disturbances",
    "Inputs",
    "Parameters",
    "State",
    "airspeed",
    "complete",
    "driven",
    "initial",
    "level",
    "lost",
    "rates",
    "truth",
]

Parameters = Airframe
BY_ATTITUDE = True
SERVES = ("position",)
START = ("V", "x", "y", "z", "gamma", "chi")


class Level(NamedTuple):
    """Level flight in still air."""

    alpha: float
    """rad."""
    mu: float
    """rad."""
    elevator: float
    """rad."""
    aileron: float
    rudder: float
    thrust: float
    """N."""
    load_factor: float
    bank: float
    """rad."""


@compiled
def rates(s, u, d, a):
    """Rates of surfaces and inner loop under the demands ``u``; the rest of `State` moves by JSBSim."""
    thrust = max(u.thrust, 0.0)
    north, east, up = wind_of(s, d)
    speed, gamma, _, mu, alpha, beta = against(s.q0, s.q1, s.q2, s.q3, s.vx - north, s.vy - east, s.vz - up)
    pace = pace_of(speed, a)
    # Only the loop uses these: how the path turns, as the nominal model has it.
    _, chi_dot, gamma_dot, _, _, _, _, _, _ = attitude_rates(
        speed, gamma, mu, alpha, beta, s.p, s.q, s.r, s.aileron, s.elevator, s.rudder, thrust, 0.0, 0.0, 0.0, a
    )
    loop = LoopState(s.n_r, s.n_r_dot, s.mu_r, s.integral)
    n_r, n_r_dot, mu_r, integral = loop_rates(
        loop, u.load_factor, u.bank, load_factor(speed, alpha, s.elevator, thrust, a), pace
    )
    aileron, elevator, rudder = deflections(
        loop, mu_r, speed, gamma, mu, alpha, beta, s.p, s.q, s.r, chi_dot, gamma_dot, s.elevator, thrust, pace, a
    )
    return (
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        surface_rate(aileron, s.aileron),
        surface_rate(elevator, s.elevator),
        surface_rate(rudder, s.rudder),
        n_r,
        n_r_dot,
        mu_r,
        integral,
    )  # fmt: skip


@compiled
def driven(s, u, d, a):
    """What JSBSim gets for a step: surfaces, thrust and the motion of the air."""
    north, east, up = wind_of(s, d)
    return Driven(s.aileron, s.elevator, s.rudder, max(u.thrust, 0.0), north, east, up)


def initial(start: Mapping[str, float], steady: Mapping[str, float]) -> State:
    """`State` of an aircraft that starts as ``start`` says, in the steady flight of `level`."""
    motion = jsbsim.initial(start, steady)
    return State(*motion, steady["aileron"], steady["elevator"], steady["rudder"], 1.0, 0.0, steady["mu"], 0.0)


def level(airframe: Airframe, V: float, flown: FlownAircraft, **disturbances: float) -> Level:
    """Level flight at ``V`` (m/s) in still air, whatever disturbs; raises TrimError where there is none."""
    found = steady_flight(flown.aircraft, flown.controls, V, flown.altitude)
    return Level(
        found.alpha, found.mu, found.elevator, found.aileron, found.rudder, found.thrust, load_factor=1.0, bank=found.mu
    )
