"""Distributed fault-tolerant containment control with several leaders.

Source: Yu, Zhang, Jiang, Su: Fault-Tolerant Cooperative Control of Unmanned Aerial Vehicles, Springer 2024, chapter 5;
equation numbers are the monograph's. Each follower estimates, from its neighbours' estimates alone, one altitude in the
convex hull of the leaders' altitudes and tracks it and the common speed in spite of elevator faults, disturbances and
saturation.

Departures from the printed law, each a gain that the `monograph` form leaves off:
- a reference shaper between observer and tracking law, and extrapolation of neighbours by the rate they send: the
  printed law does not survive neighbour values that are held between messages;
- the auxiliary signal left out of the pitch-rate reference (kappa = 0): with it, deep saturation loses the aircraft;
- a limit on the altitude error that the law sees, with conditional integration: the printed law's region of
  attraction ends between 0.5 and 1 m;
- disturbance observers fed with the command that acts, not with the one just computed (gains of fast actuators only);
- f_iq0 in (5.29) is read as f_iq; sign() is tanh(./phi) (Remark 5.6).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from ftcc.airside import ranges
from ftcc.airside.conditions import above_leaders_climb, largest_degree, stable_in_steps, weighted
from ftcc.airside.elements.filters import high_gain_observer, reference_shaper
from ftcc.airside.elements.neighbours import disagreement
from ftcc.airside.elements.nonlinear import clip
from ftcc.airside.elements.observers import disturbance_observer_rate, sliding_mode_observer
from ftcc.airside.elements.saturation import linear_auxiliary_rate
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model, airspeed_model, flight_path_model, pitch_rate_model
from ftcc.airside.scheme import Flight, Heard, Problem, Quantity, Reference
from ftcc.airside.vocabulary import ALTITUDE_MOTION, ELEVATOR_WANTED, LONGITUDINAL_DISTURBANCES, THRUST_WANTED
from ftcc.link.compiled import compiled
from ftcc.link.graph import Assumption

__all__ = ["Gains", "Output", "State", "check", "observe", "share", "start", "step"]

Q = Quantity


class Gains(NamedTuple):
    """Design parameters, then switches (0 or 1) and settings of the additions."""

    k11: Annotated[float, Q("k11", "1/s", "altitude error", 7.3)]
    k12: Annotated[float, Q("k12", "1/s^2", "integral of the altitude error", 24.1)]
    k21: Annotated[float, Q("k21", "1/s", "flight-path error", 2.2)]
    k31: Annotated[float, Q("k31", "1/s", "pitch error", 14.0)]
    k41: Annotated[float, Q("k41", "1/s", "pitch-rate error", 39.0)]
    k51: Annotated[float, Q("k51", "1/s", "speed error", 5.4)]
    k22: Annotated[float, Q("k22", "1/s", "observer of the flight-path disturbance", 6.4)]
    k42: Annotated[float, Q("k42", "1/s", "observer of the lumped pitch disturbance", 46.0)]
    k52: Annotated[float, Q("k52", "1/s", "observer of the speed disturbance", 12.1)]
    e1: Annotated[float, Q("epsilon_1", "s", "time constant of the first high-gain observer", 0.01)]
    e2: Annotated[float, Q("epsilon_2", "s", "time constant of the second high-gain observer", 0.01)]
    l1: Annotated[float, Q("l_1", "-", "damping of the first high-gain observer", 2.0)]
    l2: Annotated[float, Q("l_2", "-", "damping of the second high-gain observer", 2.0)]
    beta1: Annotated[float, Q("beta_1", "1/s", "distributed observer, linear", 8.0)]
    beta2: Annotated[float, Q("beta_2", "m/s", "distributed observer, sliding mode", 3.0)]
    phi: Annotated[float, Q("phi", "m", "boundary layer of the distributed observer (chosen)", 0.1)]
    kappa: Annotated[float, Q("kappa", "-", "share of zeta1 in the pitch-rate reference", 1.0)]
    observers: Annotated[float, Q("observers", "-", "1: disturbance observers on", 1.0)]
    auxiliary: Annotated[float, Q("auxiliary", "-", "1: auxiliary systems on", 1.0)]
    acting: Annotated[float, Q("acting", "-", "1: observers see the command in force (not in paper)", 0.0)]
    shaper: Annotated[float, Q("w", "rad/s", "pole of the reference shaper, 0: off (not in paper)", 0.0)]
    v_max: Annotated[float, Q("v_max", "m/s", "largest climb rate of the shaper (not in paper)", 2.5)]
    a_max: Annotated[float, Q("a_max", "m/s^2", "largest acceleration of the shaper (not in paper)", 1.0)]
    guard: Annotated[float, Q("c", "m", "limit on the altitude error seen, 0: off (not in paper)", 0.0)]
    horizon: Annotated[float, Q("horizon", "s", "longest extrapolation of a neighbour (not in paper)", 0.0)]
    substeps: Annotated[float, Q("n", "-", "Euler steps per tick", 1.0)]
    in_flight: Annotated[float, Q("in_flight", "-", "1: start from the present state; 0: the published zeros", 0.0)]
    z_start: Annotated[
        float, Q("z_start", "m", "altitude at which the own estimate starts", 1000.0, follows="leaders.z")
    ]
    z_unheard: Annotated[
        float, Q("z_unheard", "m", "altitude assumed of a neighbour not heard yet", 1000.0, follows="leaders.z")
    ]


RANGES = {
    ranges.FEEDBACK: "k11 k21 k31 k41 k51 k22 k42 k52 beta1",
    ranges.COUPLING: "k12 beta2",
    ranges.FILTER_TIME: "e1 e2",
    ranges.DAMPING: "l1 l2",
    ranges.LAYER: "phi",
    ranges.SHARE: "kappa",
    ranges.SWITCH: "observers auxiliary acting in_flight",
    ranges.OPTIONAL_FREQUENCY: "shaper",
    ranges.LIMIT: "v_max a_max",
    ranges.LIMIT_OR_OFF: "guard",
    ranges.TIME: "horizon",
    ranges.STEPS: "substeps",
    ranges.ALTITUDE: "z_start z_unheard",
}


class State(NamedTuple):
    """Internal states of one follower."""

    zhat: Annotated[float, Q("zhat", "m", "estimated altitude reference")]
    integral: Annotated[float, Q("I", "m s", "integral of S1")]
    xi1: Annotated[float, Q("xi1", "rad/s", "observer of d2")]
    xi2: Annotated[float, Q("xi2", "rad/s^2", "observer of the lumped pitch disturbance")]
    xi3: Annotated[float, Q("xi3", "m/s^2", "observer of d1")]
    theta_d: Annotated[float, Q("theta_d", "rad", "high-gain observer 1")]
    p1: Annotated[float, Q("p1", "rad", "its rate times epsilon_1")]
    q_d: Annotated[float, Q("q_d", "rad/s", "high-gain observer 2")]
    p2: Annotated[float, Q("p2", "rad/s", "its rate times epsilon_2")]
    zeta1: Annotated[float, Q("zeta1", "rad/s", "auxiliary system of the elevator")]
    zeta2: Annotated[float, Q("zeta2", "m/s", "auxiliary system of the thrust")]
    z_r: Annotated[float, Q("z_r", "m", "shaped reference")]
    v_r: Annotated[float, Q("v_r", "m/s", "its rate")]
    a_r: Annotated[float, Q("a_r", "m/s^2", "its acceleration")]


class Output(NamedTuple):
    """Commands first, then the other results of one evaluation of the law."""

    thrust: float
    elevator: float
    zhat_rate: float
    S1: float
    S5: float
    gamma_d: float
    d1_hat: float
    d2_hat: float
    lumped_hat: float
    elevator_wanted: float
    thrust_wanted: float


SHARED = {
    "follower": (
        Q("zhat", "m", "estimated altitude reference"),
        Q("v", "m/s", "rate of the reference", rate_of="zhat"),
    ),
    "leader": (*ALTITUDE_MOTION, Q("V", "m/s"), Q("V_dot", "m/s^2", rate_of="V")),
}
SIGNALS = (
    Q("zhat", "m", "estimated altitude reference"),
    Q("z_r", "m", "altitude reference that the law tracks"),
    Q("S1", "m", "altitude tracking error"),
    Q("S5", "m/s", "speed tracking error"),
    Q("gamma_d", "rad", "commanded flight-path angle"),
    Q("theta_d", "rad", "commanded pitch"),
    Q("q_d", "rad/s", "commanded pitch rate"),
    *LONGITUDINAL_DISTURBANCES,
    Q("zeta1", "rad/s", "auxiliary system of the elevator"),
    Q("zeta2", "m/s", "auxiliary system of the thrust"),
    ELEVATOR_WANTED,
    THRUST_WANTED,
)
TRACKING = (
    Q("z - z_d", "m", "altitude off its place between the leaders", bound=2.0),
    Q("S5", "m/s", "speed tracking error", bound=1.0),
)
GRAPH = Assumption.UNDIRECTED_LEADERS_REACH_ALL
COMMANDS = ("thrust", "elevator")
PLANT = "longitudinal"
FORMS = {
    "monograph": {},
    "flight": {
        "kappa": 0.0,
        "shaper": 2.0,
        "horizon": 0.5,
        "guard": 1.0,
        "substeps": 2.0,
        "k11": 3.0,
        "k12": 3.0,
        "k21": 2.0,
        "k31": 6.0,
        "k41": 20.0,
        "k51": 3.0,
        "k22": 2.0,
        "k42": 12.0,
        "k52": 6.0,
        "e1": 0.03,
        "e2": 0.03,
    },
}
SWITCHES = {
    "fault_tolerance": {"observers": 0.0, "auxiliary": 0.0, "guard": 0.0},
}

_FARTHEST_START = 100.0
"""From the altitude at which the estimates start: from 200 m on followers end up to 70 m off, m."""
_FARTHEST_UNSHAPED = 1.0
"""Likewise without the shaper, m."""
_LEAST_AIRSPEED = 10.0
"""Airspeed guard in every division, m/s."""


@compiled
def start(own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains) -> State:
    """State at the first tick: the published zeros, or an engagement in flight in which all estimates start at 0."""
    z, theta, q, xi1, xi3 = gains.z_start, 0.0, 0.0, 0.0, 0.0
    if gains.in_flight > 0.0:
        z, theta, q = own.z, own.theta, own.q
        xi1, xi3 = -gains.k22 * own.gamma, -gains.k52 * (own.V - reference.V)
    return State(
        zhat=z, integral=0.0, xi1=xi1, xi2=0.0, xi3=xi3,
        theta_d=theta, p1=0.0, q_d=q, p2=0.0, zeta1=0.0, zeta2=0.0,
        z_r=z, v_r=0.0, a_r=0.0,
    )  # fmt: skip


@compiled
def _substep(s, own, heard, reference, model, gains, h, ahead):
    """One Euler step of length h, everything from the states at its beginning."""
    V = own.V
    divisor = max(V, _LEAST_AIRSPEED)
    alpha = own.theta - own.gamma
    zeta1 = gains.auxiliary * s.zeta1
    zeta2 = gains.auxiliary * s.zeta2

    # Distributed observer (5.12) and shaper.
    total, weights, rates = disagreement(s.zhat, heard, ahead, gains.horizon, gains.z_unheard, gains.in_flight)
    zhat_rate, slope = sliding_mode_observer(total, gains.beta1, gains.beta2, gains.phi)
    if gains.shaper > 0.0:
        z_ref, v_ref, a_ref = s.z_r, s.v_r, s.a_r
        z_r_rate, v_r_rate, a_r_rate = reference_shaper(
            s.z_r, s.v_r, s.a_r, s.zhat, zhat_rate, gains.shaper, gains.v_max, gains.a_max
        )
    else:
        z_ref, v_ref, a_ref = s.zhat, zhat_rate, slope * (weights * zhat_rate - rates)
        z_r_rate, v_r_rate, a_r_rate = 0.0, 0.0, 0.0

    # Speed (5.34)-(5.39).
    f_v, g_v = airspeed_model(V, own.gamma, alpha, model)
    S5 = V - reference.V
    d1_hat = gains.observers * (s.xi3 + gains.k52 * S5)
    thrust_wanted = (-gains.k51 * S5 - f_v + reference.V_dot - d1_hat + 0.5 * gains.k51 * zeta2) / g_v
    thrust = clip(thrust_wanted, model.thrust_min, model.thrust_max)

    # Altitude (5.18).
    S1 = own.z - z_ref
    seen = S1
    damped = gains.k11 * (V * math.sin(own.gamma) - v_ref)
    integral_rate = S1
    if gains.guard > 0.0:
        seen = clip(S1, -gains.guard, gains.guard)
        if seen != S1:
            damped = 0.0
        integral_rate = seen
        if gains.k12 * abs(s.integral) >= gains.k11 * gains.guard and s.integral * seen > 0.0:
            integral_rate = 0.0
    gamma_d = (-gains.k11 * seen - gains.k12 * s.integral + v_ref) / divisor
    V_rate = f_v + g_v * thrust + d1_hat
    gamma_d_rate = (-damped - gains.k12 * integral_rate + a_ref) / divisor - gamma_d * V_rate / divisor

    # Step 1: flight path (5.19)-(5.24).
    f_g, g_g = flight_path_model(V, own.gamma, divisor, model)
    S2 = own.gamma - gamma_d
    d2_hat = gains.observers * (s.xi1 + gains.k22 * S2)
    theta_bar = (-gains.k21 * S2 - f_g + gamma_d_rate - d2_hat) / g_g
    theta_d_rate, p1_rate = high_gain_observer(s.theta_d, s.p1, theta_bar, gains.e1, gains.l1)

    # Step 2: pitch (5.25)-(5.27).
    S3 = own.theta - s.theta_d
    q_bar = -gains.k31 * S3 + theta_d_rate - gains.kappa * zeta1
    q_d_rate, p2_rate = high_gain_observer(s.q_d, s.p2, q_bar, gains.e2, gains.l2)

    # Step 3: pitch rate (5.28)-(5.33).
    f_q, g_q = pitch_rate_model(V, alpha, own.q, divisor, model)
    S4 = own.q - s.q_d
    lumped_hat = gains.observers * (s.xi2 + gains.k42 * S4)
    elevator_wanted = (-gains.k41 * S4 - f_q + q_d_rate - lumped_hat + 0.5 * gains.k41 * zeta1) / g_q
    elevator = clip(elevator_wanted, model.elevator_min, model.elevator_max)

    acting_thrust, acting_elevator = thrust, elevator
    if gains.acting > 0.0:
        acting_thrust, acting_elevator = own.thrust, own.elevator
    xi1_rate = disturbance_observer_rate(gains.k22, S2, s.xi1, f_g + g_g * own.theta, gamma_d_rate)
    xi2_rate = disturbance_observer_rate(gains.k42, S4, s.xi2, f_q + g_q * acting_elevator, q_d_rate)
    xi3_rate = disturbance_observer_rate(gains.k52, S5, s.xi3, f_v + g_v * acting_thrust, reference.V_dot)

    after = State(
        zhat=s.zhat + h * zhat_rate,
        integral=s.integral + h * integral_rate,
        xi1=s.xi1 + h * xi1_rate,
        xi2=s.xi2 + h * xi2_rate,
        xi3=s.xi3 + h * xi3_rate,
        theta_d=s.theta_d + h * theta_d_rate,
        p1=s.p1 + h * p1_rate,
        q_d=s.q_d + h * q_d_rate,
        p2=s.p2 + h * p2_rate,
        zeta1=s.zeta1 + h * linear_auxiliary_rate(s.zeta1, 0.5 * gains.k41, g_q, elevator, elevator_wanted),
        zeta2=s.zeta2 + h * linear_auxiliary_rate(s.zeta2, 0.5 * gains.k51, g_v, thrust, thrust_wanted),
        z_r=s.z_r + h * z_r_rate,
        v_r=s.v_r + h * v_r_rate,
        a_r=s.a_r + h * a_r_rate,
    )
    output = Output(
        thrust=thrust, elevator=elevator,
        zhat_rate=zhat_rate, S1=S1, S5=S5, gamma_d=gamma_d,
        d1_hat=d1_hat, d2_hat=d2_hat, lumped_hat=lumped_hat,
        elevator_wanted=elevator_wanted, thrust_wanted=thrust_wanted,
    )  # fmt: skip
    return after, output


@compiled
def step(state: State, own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains, dt: float):
    """One tick: the state ``dt`` later, and the output of the first sub-step."""
    h = dt / gains.substeps
    after, output = _substep(state, own, heard, reference, model, gains, h, 0.0)
    for n in range(1, int(gains.substeps)):
        after, _ = _substep(after, own, heard, reference, model, gains, h, n * h)
    return after, output


@compiled
def share(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values sent to the neighbours, at the time of ``state``, in the order of `SHARED`."""
    return state.zhat, (state.v_r if gains.shaper > 0.0 else output.zhat_rate)


@compiled
def observe(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values of `SIGNALS`, at the time of ``state``."""
    return (
        state.zhat,
        state.z_r if gains.shaper > 0.0 else state.zhat,
        output.S1,
        output.S5,
        output.gamma_d,
        state.theta_d,
        state.q_d,
        output.d1_hat,
        output.d2_hat,
        output.lumped_hat,
        state.zeta1,
        state.zeta2,
        output.elevator_wanted,
        output.thrust_wanted,
    )


def climb_limit(gains: Gains) -> float:
    """Climb rate of a leader, m/s, that the estimates can just follow: that of the observer, that of the shaper."""
    return min(gains.beta2, gains.v_max) if gains.shaper > 0.0 else gains.beta2


def _starts(gains: Gains, flight: Flight) -> list[Problem]:
    """Whether the published start, from zeros and ``z_start``, is near enough to that of the aircraft."""
    problems = []
    for uav, initial in flight.initial.items():
        away = initial.z - gains.z_start
        side = "above" if away > 0.0 else "below"
        text = (
            f"UAV {uav} starts at z = {initial.z:g} m, {abs(away):g} m {side} where its estimate starts (gain z_start)"
        )
        if abs(away) > _FARTHEST_START:
            problems.append(
                Problem(
                    True,
                    f"{text}: at most {_FARTHEST_START:g} m can be flown; gain in_flight = 1 starts the estimate there",
                )
            )
        elif abs(away) > _FARTHEST_UNSHAPED and gains.shaper == 0.0:
            problems.append(Problem(False, f"{text}: without the shaper, aircraft were lost from 5 m on"))
    return problems


def check(gains: Gains, flight: Flight) -> list[Problem]:
    """Conditions on the gains, from the chapter or from the sampling of the law."""
    problems = above_leaders_climb(gains, "beta2", flight, "Theorem 5.1")
    if gains.in_flight == 0.0:
        problems += _starts(gains, flight)
    if flight.leader_speed_varies:
        problems.append(
            Problem(True, "the leaders' speed must be constant and the mission's, as which followers know it")
        )
    h = flight.period / gains.substeps
    degree = largest_degree(flight)
    rates = {
        "e1": 1.0 / gains.e1,
        "e2": 1.0 / gains.e2,
        weighted("beta1, beta2 / phi", degree): degree * (gains.beta1 + gains.beta2 / gains.phi),
        "k42": gains.k42,
        "k41": gains.k41,
    }
    problems += stable_in_steps(rates, h)
    return problems
