"""Distributed finite-time fault-tolerant containment in position and altitude, without a model.

Source: Yu, Zhang, Jiang, Su: Fault-Tolerant Cooperative Control of Unmanned Aerial Vehicles, Springer 2024, chapter 6;
equation numbers are the monograph's. Each follower estimates, from its neighbours' estimates alone, one position and
velocity in the convex hull of the leaders' and tracks them by finite-time backstepping with adapted gains;
aerodynamics are unknown, elevator faults and saturation are tolerated. There is no integrator by design: the adapted
gains grow until a small steady error holds the trim.

Departures from the printed law:
- misprints: the last term of (6.56) has S4 and chi22, the leak of (6.58) is on chi22 (as printed a vehicle is lost);
  the second line of (6.42) is Levant's. sign() is tanh(./kappa) where it is discontinuous. Networks and the gains of
  the differentiators are chosen;
- adapted gains and auxiliary systems are stepped semi-implicitly;
- in the `flight` form (gains): adaptation held while its command is saturated, caps on the adapted gains, sub-steps;
- neighbours are extrapolated to the present by the velocity that they send, also within a control step: held positions
  would bias the estimate by 55 mm per ms of age. With ideal exchange this adds nothing;
- one-sample prediction of the measurement (gain ``prediction``), which a control rate of 100 Hz needs.

The file is long because the law has twice as many gains and states as others, each with its unit and meaning.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from ftcc.airside import ranges
from ftcc.airside.conditions import largest_degree, stable_in_steps, weighted
from ftcc.airside.elements.filters import butterworth, sliding_mode_differentiator
from ftcc.airside.elements.neighbours import motion_sums
from ftcc.airside.elements.networks import adaptation_step, diagonal_energy, learned_gain
from ftcc.airside.elements.nonlinear import clip, signed_power
from ftcc.airside.elements.observers import finite_time_observer
from ftcc.airside.elements.saturation import squared_auxiliary_step
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.scheme import Flight, Heard, Problem, Quantity, Reference, quantities
from ftcc.airside.vocabulary import ELEVATOR_WANTED, PLANE_MOTION, THRUST_WANTED
from ftcc.link.compiled import compiled
from ftcc.link.graph import Assumption

__all__ = ["Gains", "Output", "State", "check", "observe", "share", "start", "step"]

Q = Quantity


class Gains(NamedTuple):
    """Design parameters (table 6.2), then switches (0 or 1) and settings of the additions."""

    beta1: Annotated[float, Q("beta_1", "-", "distributed observer, position, fractional", 0.5)]
    beta2: Annotated[float, Q("beta_2", "m/s", "distributed observer, position, sliding mode", 0.3)]
    beta3: Annotated[float, Q("beta_3", "-", "distributed observer, velocity, fractional", 0.2)]
    beta4: Annotated[float, Q("beta_4", "m/s^2", "distributed observer, velocity, sliding mode", 3.0)]
    a: Annotated[float, Q("a", "-", "its exponent", 0.4)]
    kappa: Annotated[float, Q("kappa", "-", "its boundary layer", 0.02)]
    b1: Annotated[float, Q("b1", "-", "finite-time term of S1", 0.2)]
    b2: Annotated[float, Q("b2", "-", "finite-time term of S2", 0.4)]
    b3: Annotated[float, Q("b3", "-", "finite-time term of S3", 0.05)]
    b4: Annotated[float, Q("b4", "-", "finite-time term of S4", 0.33)]
    b5: Annotated[float, Q("b5", "-", "finite-time term of S5", 0.1)]
    b6: Annotated[float, Q("b6", "-", "finite-time term of S6", 0.2)]
    r: Annotated[float, Q("r", "-", "exponent of the finite-time terms", 0.8)]
    k11: Annotated[float, Q("k11", "1/s", "position error", 0.2)]
    k21: Annotated[float, Q("k21", "N s/m", "speed error", 2.0)]
    k22: Annotated[float, Q("k22", "1/s", "auxiliary system of the thrust", 1.1)]
    k31: Annotated[float, Q("k31", "1/s", "altitude error", 0.8)]
    k41: Annotated[float, Q("k41", "-", "flight-path error", 3.0)]
    k51: Annotated[float, Q("k51", "1/s", "angle-of-attack error", 2.06)]
    k61: Annotated[float, Q("k61", "s", "pitch-rate error", 1.35)]
    k62: Annotated[float, Q("k62", "1/s", "auxiliary system of the elevator", 1.2)]
    z11: Annotated[float, Q("zeta11", "-", "network of the speed", 0.6)]
    z12: Annotated[float, Q("zeta12", "-", "bound of the speed", 0.15)]
    z21: Annotated[float, Q("zeta21", "-", "network of the flight path", 0.45)]
    z22: Annotated[float, Q("zeta22", "-", "bound of the flight path", 0.3)]
    z31: Annotated[float, Q("zeta31", "-", "network of the angle of attack", 1.34)]
    z32: Annotated[float, Q("zeta32", "-", "bound of the angle of attack", 0.4)]
    z41: Annotated[float, Q("zeta41", "-", "network of the pitch rate", 1.8)]
    z42: Annotated[float, Q("zeta42", "-", "bound of the pitch rate", 0.49)]
    g11: Annotated[float, Q("g11", "-", "adaptation rate of chi11", 15.0)]
    g12: Annotated[float, Q("g12", "-", "adaptation rate of chi12", 13.0)]
    g21: Annotated[float, Q("g21", "-", "adaptation rate of chi21", 15.0)]
    g22: Annotated[float, Q("g22", "-", "adaptation rate of chi22", 12.0)]
    g31: Annotated[float, Q("g31", "-", "adaptation rate of chi31", 20.0)]
    g32: Annotated[float, Q("g32", "-", "adaptation rate of chi32", 30.0)]
    g41: Annotated[float, Q("g41", "-", "adaptation rate of chi41", 8.2)]
    g42: Annotated[float, Q("g42", "-", "adaptation rate of chi42", 10.3)]
    h11: Annotated[float, Q("h11", "-", "leak of chi11", 0.001)]
    h12: Annotated[float, Q("h12", "-", "leak of chi12", 0.002)]
    h21: Annotated[float, Q("h21", "-", "leak of chi21", 0.008)]
    h22: Annotated[float, Q("h22", "-", "leak of chi22", 0.05)]
    h31: Annotated[float, Q("h31", "-", "leak of chi31", 0.02)]
    h32: Annotated[float, Q("h32", "-", "leak of chi32", 0.03)]
    h41: Annotated[float, Q("h41", "-", "leak of chi41", 0.05)]
    h42: Annotated[float, Q("h42", "-", "leak of chi42", 0.8)]
    nu1: Annotated[float, Q("nu1", "-", "threshold of the auxiliary system of the thrust", 0.005)]
    nu2: Annotated[float, Q("nu2", "-", "threshold of the auxiliary system of the elevator", 0.005)]
    mu1: Annotated[float, Q("mu1", "-", "differentiators, fractional (chosen)", 6.0)]
    mu2: Annotated[float, Q("mu2", "-", "differentiators, sliding mode (chosen)", 10.0)]
    width: Annotated[float, Q("n", "-", "width of the networks' nodes (chosen)", 2.0)]
    low_pass: Annotated[float, Q("w_f", "rad/s", "low-pass that breaks the networks' algebraic loops", 1.0)]
    auxiliary: Annotated[float, Q("auxiliary", "-", "1: auxiliary systems on", 1.0)]
    adapt_thrust: Annotated[float, Q("adapt_thrust", "-", "1: chi11, chi12 adapt; 0: held", 1.0)]
    adapt_elevator: Annotated[float, Q("adapt_elevator", "-", "1: chi21 .. chi42 adapt; 0: held", 1.0)]
    adapt_until: Annotated[float, Q("adapt_until", "s", "chi21 .. chi42 are frozen from then on, 0: never", 0.0)]
    guards: Annotated[float, Q("guards", "-", "1: no adaptation in saturation, and caps (not in paper)", 0.0)]
    cap1: Annotated[float, Q("chi_max1", "-", "cap of chi11, chi12 (not in paper)", 60.0)]
    cap2: Annotated[float, Q("chi_max2", "-", "cap of chi21 .. chi32 (not in paper)", 2.0)]
    cap4: Annotated[float, Q("chi_max4", "-", "cap of chi41, chi42 (not in paper)", 1.0)]
    substeps: Annotated[float, Q("n_s", "-", "internal steps per tick", 1.0)]
    extrapolation: Annotated[
        float, Q("extrapolation", "-", "1: neighbours carried to the present, 0: held (not in paper)", 1.0)
    ]
    growth: Annotated[float, Q("growth", "-", "1: neighbours move on within a tick (not in paper)", 0.0)]
    prediction: Annotated[float, Q("prediction", "-", "1: one-sample prediction (not in paper)", 0.0)]


RANGES = {
    ranges.FEEDBACK: "beta1 beta2 beta3 beta4 k11 k21 k22 k31 k41 k51 k61 k62 mu1 mu2",
    ranges.EXPONENT: "a r",
    ranges.LAYER: "kappa nu1 nu2 width",
    ranges.FINITE_TIME: "b1 b2 b3 b4 b5 b6",
    ranges.WEIGHT: "z11 z12 z21 z22 z31 z32 z41 z42",
    ranges.ADAPTATION: "g11 g12 g21 g22 g31 g32 g41 g42",
    ranges.LEAK: "h11 h12 h21 h22 h31 h32 h41 h42",
    ranges.FREQUENCY: "low_pass",
    ranges.SWITCH: "auxiliary adapt_thrust adapt_elevator guards extrapolation growth prediction",
    ranges.TIME: "adapt_until",
    ranges.LIMIT: "cap1 cap2 cap4",
    ranges.STEPS: "substeps",
}


class State(NamedTuple):
    """Internal states of one follower."""

    x_hat: Annotated[float, Q("x_hat", "m", "estimated position reference")]
    Vx_hat: Annotated[float, Q("Vx_hat", "m/s", "its rate", rate_of="x_hat")]
    z_hat: Annotated[float, Q("z_hat", "m", "estimated altitude reference")]
    Vz_hat: Annotated[float, Q("Vz_hat", "m/s", "its rate", rate_of="z_hat")]
    c11: Annotated[float, Q("chi11", "-", "adapted gain of the speed, network")]
    c12: Annotated[float, Q("chi12", "-", "adapted gain of the speed")]
    c21: Annotated[float, Q("chi21", "-", "adapted gain of the flight path, network")]
    c22: Annotated[float, Q("chi22", "-", "adapted gain of the flight path")]
    c31: Annotated[float, Q("chi31", "-", "adapted gain of the angle of attack, network")]
    c32: Annotated[float, Q("chi32", "-", "adapted gain of the angle of attack")]
    c41: Annotated[float, Q("chi41", "-", "adapted gain of the pitch rate, network")]
    c42: Annotated[float, Q("chi42", "-", "adapted gain of the pitch rate")]
    eta1: Annotated[float, Q("eta1", "-", "auxiliary system of the thrust")]
    eta2: Annotated[float, Q("eta2", "-", "auxiliary system of the elevator")]
    u1_f: Annotated[float, Q("u1_f", "N", "low-pass of the thrust command")]
    u1_f_rate: Annotated[float, Q("u1_f'", "N/s", "its rate")]
    alpha_f: Annotated[float, Q("alpha_f", "rad", "low-pass of the angle of attack")]
    alpha_f_rate: Annotated[float, Q("alpha_f'", "rad/s", "its rate")]
    u2_f: Annotated[float, Q("u2_f", "rad", "low-pass of the elevator command")]
    u2_f_rate: Annotated[float, Q("u2_f'", "rad/s", "its rate")]
    p2: Annotated[float, Q("p2", "m/s", "differentiator of the speed command")]
    d2: Annotated[float, Q("d2", "m/s^2", "its derivative")]
    p4: Annotated[float, Q("p4", "rad", "differentiator of the flight-path command")]
    d4: Annotated[float, Q("d4", "rad/s", "its derivative")]
    p5: Annotated[float, Q("p5", "rad", "differentiator of the angle-of-attack command")]
    d5: Annotated[float, Q("d5", "rad/s", "its derivative")]
    p6: Annotated[float, Q("p6", "rad/s", "differentiator of the pitch-rate command")]
    d6: Annotated[float, Q("d6", "rad/s^2", "its derivative")]
    V_before: Annotated[float, Q("V_before", "m/s", "airspeed at the tick before")]
    gamma_before: Annotated[float, Q("gamma_before", "rad", "flight-path angle at the tick before")]
    alpha_before: Annotated[float, Q("alpha_before", "rad", "angle of attack at the tick before")]
    q_before: Annotated[float, Q("q_before", "rad/s", "pitch rate at the tick before")]


class Output(NamedTuple):
    """One evaluation of the law, held over the tick: commands first, then errors, virtual controls and networks."""

    thrust: float
    elevator: float
    thrust_wanted: float
    elevator_wanted: float
    S1: float
    S2: float
    S3: float
    S4: float
    S5: float
    S6: float
    x2d: float
    x4d: float
    x5d: float
    x6d: float
    P1: float
    P2: float
    P3: float
    P4: float


_S = quantities(State)
_ESTIMATES = tuple(_S[name] for name in ("x_hat", "Vx_hat", "z_hat", "Vz_hat"))
SHARED = {"follower": _ESTIMATES, "leader": PLANE_MOTION}
_FORWARD, _VERTICAL = 0, 2
"""Columns of what is shared: position, then speed."""
SIGNALS = (
    *_ESTIMATES,
    Q("S1", "m", "position tracking error"),
    Q("S2", "m/s", "speed error"),
    Q("S3", "m", "altitude tracking error"),
    Q("S4", "rad", "flight-path error"),
    Q("S5", "rad", "angle-of-attack error"),
    Q("S6", "rad/s", "pitch-rate error"),
    *(_S[name] for name in ("c11", "c12", "c21", "c22", "c31", "c32", "c41", "c42", "eta1", "eta2")),
    THRUST_WANTED,
    ELEVATOR_WANTED,
)
TRACKING = (
    Q("x - x_d", "m", "position off its place between the leaders", bound=5.0),
    Q("z - z_d", "m", "altitude off its place between the leaders", bound=2.0),
)
GRAPH = Assumption.UNDIRECTED_LEADERS_REACH_ALL
COMMANDS = ("thrust", "elevator")
PLANT = "longitudinal"
FORMS = {
    "monograph": {},
    "flight": {"guards": 1.0, "growth": 1.0, "substeps": 5.0},
}
SWITCHES = {
    "fault_tolerance": {"adapt_elevator": 0.0},
    "adaptation": {"adapt_thrust": 0.0, "adapt_elevator": 0.0},
    "finite_time": {"b1": 0.0, "b2": 0.0, "b3": 0.0, "b4": 0.0, "b5": 0.0, "b6": 0.0},
    "auxiliary": {"auxiliary": 0.0},
    "predictive": {"prediction": 1.0},
}

_LEAST_AIRSPEED = 5.0
"""Airspeed guard of (6.53), m/s."""

_AUXILIARY_START = 0.01
"""Of both auxiliary systems."""
_LEAST_COSINE = 0.2
"""Guard of cos(gamma) in (6.31)."""

# The networks, all chosen: nodes, and what counts as 0 and as 1 in an input.
_NODES = 5
"""Of each network, equally spaced on its diagonal."""
_CRUISE, _SPEED_SCALE = 30.0, 5.0
"""m/s."""
_CRUISE_THRUST, _THRUST_SCALE = 30.0, 30.0
"""N."""
_ANGLE_SCALE = 0.2
"""rad."""
_ACCELERATION_SCALE, _TURN_SCALE, _PITCHING_SCALE, _PITCH_ACCELERATION_SCALE = 2.0, 0.5, 2.0, 10.0
"""Derivatives of the commands of speed m/s^2, flight path rad/s, angle of attack rad/s and pitch rate rad/s^2."""
_ELEVATOR_SCALE = 0.5
"""rad; a pitch rate counts in rad/s."""


@compiled
def _adapted(k, c1, energy, zeta1, c2, zeta2):
    """Gain on an error: the fixed one, and those learned of the network and of the bound."""
    return k + learned_gain(c1, energy, zeta1) + learned_gain(c2, 1.0, zeta2)


@compiled
def _evaluate(s, own, V, gamma, alpha, q, model, g):
    """Eqs. (6.31)-(6.78) for the states ``s`` as they stand."""
    speed, path, attack = (V - _CRUISE) / _SPEED_SCALE, gamma / _ANGLE_SCALE, alpha / _ANGLE_SCALE

    # Forward (6.31)-(6.46).
    S1 = own.x - s.x_hat
    x2d = (-g.k11 * S1 + s.Vx_hat) / max(math.cos(gamma), _LEAST_COSINE)
    S2 = V - x2d + g.b1 * signed_power(S1, g.r)
    thrust_input = (s.u1_f - _CRUISE_THRUST) / _THRUST_SCALE
    P1 = diagonal_energy((speed, thrust_input, s.d2 / _ACCELERATION_SCALE, path, attack), _NODES, g.width)
    thrust_wanted = (
        -_adapted(g.k21, s.c11, P1, g.z11, s.c12, g.z12) * S2
        - g.b2 * signed_power(S2, g.r)
        + g.auxiliary * g.k22 * s.eta1
    )
    thrust = clip(thrust_wanted, model.thrust_min, model.thrust_max)

    # Altitude (6.48), (6.53) and flight path (6.49), (6.56).
    S3 = own.z - s.z_hat
    x4d = (-g.k31 * S3 + s.Vz_hat) / max(V, _LEAST_AIRSPEED)
    S4 = gamma - x4d + g.b3 * signed_power(S3, g.r)
    P2 = diagonal_energy((speed, path, s.d4 / _TURN_SCALE, s.alpha_f / _ANGLE_SCALE), _NODES, g.width)
    x5d = -_adapted(g.k41, s.c21, P2, g.z21, s.c22, g.z22) * S4

    # Angle of attack (6.50), (6.63).
    S5 = alpha - x5d + g.b4 * signed_power(S4, g.r)
    P3 = diagonal_energy((speed, path, attack, s.d5 / _PITCHING_SCALE), _NODES, g.width)
    x6d = -_adapted(g.k51, s.c31, P3, g.z31, s.c32, g.z32) * S5

    # Pitch rate (6.51), (6.70)-(6.78); positive u pitches up.
    S6 = q - x6d + g.b5 * signed_power(S5, g.r)
    turning, elevator_input = s.d6 / _PITCH_ACCELERATION_SCALE, s.u2_f / _ELEVATOR_SCALE
    P4 = diagonal_energy((speed, path, attack, q, turning, elevator_input), _NODES, g.width)
    u_wanted = (
        -_adapted(g.k61, s.c41, P4, g.z41, s.c42, g.z42) * S6
        - g.b6 * signed_power(S6, g.r)
        + g.auxiliary * g.k62 * s.eta2
    )
    u = clip(u_wanted, -model.elevator_max, -model.elevator_min)
    return Output(
        thrust=thrust, elevator=-u, thrust_wanted=thrust_wanted, elevator_wanted=-u_wanted,
        S1=S1, S2=S2, S3=S3, S4=S4, S5=S5, S6=S6,
        x2d=x2d, x4d=x4d, x5d=x5d, x6d=x6d,
        P1=P1, P2=P2, P3=P3, P4=P4,
    )  # fmt: skip


@compiled
def _learned(estimate, error, energy, zeta, rate, leak, learns, cap, h):
    """An adapted gain after ``h`` seconds; held unless ``learns``."""
    if not learns:
        return estimate
    return min(adaptation_step(estimate, error, energy, zeta, rate, leak, h), cap)


@compiled
def _estimated(place, speed, neighbours, ahead, g):
    """Rates of the estimates of one axis (6.22)-(6.23), ``ahead`` seconds after the tick, see `motion_sums`."""
    weights, places, speeds = neighbours
    away = weights * place - (places + ahead * speeds)
    return finite_time_observer(speed, away, weights * speed - speeds, g.beta1, g.beta2, g.beta3, g.beta4, g.a, g.kappa)


@compiled
def _advance(s, law, own, forward, vertical, ahead, learns_thrust, learns_elevator, g, h):
    """One internal step of length ``h``, ``ahead`` seconds after the tick, with the evaluation ``law`` held."""
    x_rate, Vx_rate = _estimated(s.x_hat, s.Vx_hat, forward, ahead, g)
    z_rate, Vz_rate = _estimated(s.z_hat, s.Vz_hat, vertical, ahead, g)
    cap1, cap2, cap4 = math.inf, math.inf, math.inf
    if g.guards > 0.0:
        cap1, cap2, cap4 = g.cap1, g.cap2, g.cap4
    u1_f_rate, u1_f_acceleration = butterworth(s.u1_f, s.u1_f_rate, law.thrust, g.low_pass)
    alpha_f_rate, alpha_f_acceleration = butterworth(s.alpha_f, s.alpha_f_rate, own.alpha, g.low_pass)
    u2_f_rate, u2_f_acceleration = butterworth(s.u2_f, s.u2_f_rate, -law.elevator, g.low_pass)
    p2_rate, d2_rate = sliding_mode_differentiator(s.p2, s.d2, law.x2d, g.mu1, g.mu2)
    p4_rate, d4_rate = sliding_mode_differentiator(s.p4, s.d4, law.x4d, g.mu1, g.mu2)
    p5_rate, d5_rate = sliding_mode_differentiator(s.p5, s.d5, law.x5d, g.mu1, g.mu2)
    p6_rate, d6_rate = sliding_mode_differentiator(s.p6, s.d6, law.x6d, g.mu1, g.mu2)
    return State(
        x_hat=s.x_hat + h * x_rate,
        Vx_hat=s.Vx_hat + h * Vx_rate,
        z_hat=s.z_hat + h * z_rate,
        Vz_hat=s.Vz_hat + h * Vz_rate,
        c11=_learned(s.c11, law.S2, law.P1, g.z11, g.g11, g.h11, learns_thrust, cap1, h),
        c12=_learned(s.c12, law.S2, 1.0, g.z12, g.g12, g.h12, learns_thrust, cap1, h),
        c21=_learned(s.c21, law.S4, law.P2, g.z21, g.g21, g.h21, learns_elevator, cap2, h),
        c22=_learned(s.c22, law.S4, 1.0, g.z22, g.g22, g.h22, learns_elevator, cap2, h),
        c31=_learned(s.c31, law.S5, law.P3, g.z31, g.g31, g.h31, learns_elevator, cap2, h),
        c32=_learned(s.c32, law.S5, 1.0, g.z32, g.g32, g.h32, learns_elevator, cap2, h),
        c41=_learned(s.c41, law.S6, law.P4, g.z41, g.g41, g.h41, learns_elevator, cap4, h),
        c42=_learned(s.c42, law.S6, 1.0, g.z42, g.g42, g.h42, learns_elevator, cap4, h),
        eta1=squared_auxiliary_step(s.eta1, g.k22, law.S2, law.thrust - law.thrust_wanted, g.nu1, h),
        eta2=squared_auxiliary_step(s.eta2, g.k62, law.S6, law.elevator_wanted - law.elevator, g.nu2, h),
        u1_f=s.u1_f + h * u1_f_rate,
        u1_f_rate=s.u1_f_rate + h * u1_f_acceleration,
        alpha_f=s.alpha_f + h * alpha_f_rate,
        alpha_f_rate=s.alpha_f_rate + h * alpha_f_acceleration,
        u2_f=s.u2_f + h * u2_f_rate,
        u2_f_rate=s.u2_f_rate + h * u2_f_acceleration,
        p2=s.p2 + h * p2_rate,
        d2=s.d2 + h * d2_rate,
        p4=s.p4 + h * p4_rate,
        d4=s.d4 + h * d4_rate,
        p5=s.p5 + h * p5_rate,
        d5=s.d5 + h * d5_rate,
        p6=s.p6 + h * p6_rate,
        d6=s.d6 + h * d6_rate,
        V_before=own.V,
        gamma_before=own.gamma,
        alpha_before=own.alpha,
        q_before=own.q,
    )


@compiled
def start(own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains) -> State:
    """State at the first tick: estimates at the own motion, filters at the present command and attitude."""
    V_x = own.V * math.cos(own.gamma)
    return State(
        x_hat=own.x, Vx_hat=V_x, z_hat=own.z, Vz_hat=own.V * math.sin(own.gamma),
        c11=0.0, c12=0.0, c21=0.0, c22=0.0, c31=0.0, c32=0.0, c41=0.0, c42=0.0,
        eta1=_AUXILIARY_START, eta2=_AUXILIARY_START,
        u1_f=own.thrust, u1_f_rate=0.0, alpha_f=own.alpha, alpha_f_rate=0.0, u2_f=-own.elevator, u2_f_rate=0.0,
        p2=V_x, d2=0.0, p4=0.0, d4=0.0, p5=0.0, d5=0.0, p6=0.0, d6=0.0,
        V_before=own.V, gamma_before=own.gamma, alpha_before=own.alpha, q_before=own.q,
    )  # fmt: skip


@compiled
def step(state: State, own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains, dt: float):
    """One tick: the state ``dt`` later, by internal steps with the evaluation of the tick held, and the output."""
    V, gamma, alpha, q = own.V, own.gamma, own.alpha, own.q
    if gains.prediction > 0.0:
        V += V - state.V_before
        gamma += gamma - state.gamma_before
        alpha += alpha - state.alpha_before
        q += q - state.q_before
    law = _evaluate(state, own, V, gamma, alpha, q, model, gains)
    forward = motion_sums(heard, _FORWARD, gains.extrapolation)
    vertical = motion_sums(heard, _VERTICAL, gains.extrapolation)
    learns_thrust = gains.adapt_thrust > 0.0
    learns_elevator = gains.adapt_elevator > 0.0 and not 0.0 < gains.adapt_until <= own.t
    if gains.guards > 0.0:
        learns_thrust = learns_thrust and law.thrust == law.thrust_wanted
        learns_elevator = learns_elevator and law.elevator == law.elevator_wanted
    h = dt / gains.substeps
    after = state
    for n in range(int(gains.substeps)):
        ahead = gains.growth * n * h
        after = _advance(after, law, own, forward, vertical, ahead, learns_thrust, learns_elevator, gains, h)
    return after, law


@compiled
def share(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values sent to the neighbours, at the time of ``state``, in the order of `SHARED`."""
    return state.x_hat, state.Vx_hat, state.z_hat, state.Vz_hat


@compiled
def observe(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values of `SIGNALS`, at the time of ``state``."""
    s = state
    return (
        s.x_hat, s.Vx_hat, s.z_hat, s.Vz_hat,
        output.S1, output.S2, output.S3, output.S4, output.S5, output.S6,
        s.c11, s.c12, s.c21, s.c22, s.c31, s.c32, s.c41, s.c42, s.eta1, s.eta2,
        output.thrust_wanted, output.elevator_wanted,
    )  # fmt: skip


def check(gains: Gains, flight: Flight) -> list[Problem]:
    """Conditions on the gains, from the chapter or from the sampling of the law."""
    problems = []
    if gains.beta4 <= flight.leader_acceleration:
        problems.append(
            Problem(
                True,
                f"gain beta4 = {gains.beta4:g} m/s^2: must exceed the leaders' largest acceleration, "
                f"{flight.leader_acceleration:.3f} m/s^2 (Lemma 6.6)",
            )
        )
    degree = largest_degree(flight)
    rates = {
        weighted("beta4 / kappa", degree): degree * gains.beta4 / gains.kappa,
        weighted("beta2 / kappa", degree): degree * gains.beta2 / gains.kappa,
        "low_pass": math.sqrt(2.0) * gains.low_pass,  # 600 rad/s flies as 1 does, 1500 loses the aircraft
    }
    problems += stable_in_steps(rates, flight.period / gains.substeps)
    if flight.period > (0.01 if gains.prediction > 0.0 else 0.008):
        problems.append(
            Problem(
                False,
                f"control rate {1.0 / flight.period:.0f} Hz: behind one sample of delay the elevator limit-cycles "
                "below 125 Hz (100 Hz with gain prediction = 1)",
            )
        )
    return problems
