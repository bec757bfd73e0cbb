"""Distributed fault-tolerant altitude tracking with prescribed performance.

Source: Yu, Zhang, Jiang, Su: Fault-Tolerant Cooperative Control of Unmanned Aerial Vehicles, Springer 2024, chapter 3;
equation numbers are the monograph's. Each follower estimates the leader's altitude from its neighbours' estimates alone
and keeps its own altitude inside a decaying tube around that estimate, in spite of elevator faults, disturbances and
elevator saturation; the speed is held by a PID law.

Departures from the printed law, each a gain; the `monograph` form has only the first:
- tau1 is 0.15 s: as printed (0.05 s) the loop diverges, because xi' contains the flight-path angle and is multiplied by
  1/tau1. The `flight` form drops the xi' term and has 0.25 s;
- the inner gain divided by a third of the elevator's nominal effectiveness, and an estimator of the pitch acceleration
  that it does not explain: this carries the fault at a moderate gain. The printed inner loop needs 1 kHz;
- a lead against the servo's lag;
- a smoothed reference, a filtered rate and a limit on the observer's rate: the chain of filters multiplies every step
  of the reference by 1/(tau1 tau2 tau3). Altitude through a complementary filter, for the same reason;
- limits on the virtual controls and on the adapted parameters: recovery from saturation instead of a limit cycle;
- the speed integral held while the thrust command is saturated;
- neighbours extrapolated by the rate that they send.
Networks (sizes, centres, widths) are chosen; sign() is tanh(./phi). The file is long because the law has many
gains, states and conditions to check; `_evaluate` is the law itself, in the order of the chapter.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from ftcc.airside import ranges
from ftcc.airside.conditions import above_leaders_climb, largest_degree, stable_in_steps, weighted
from ftcc.airside.elements.actuators import lead_filter
from ftcc.airside.elements.filters import butterworth, complementary_rate, first_order_rate, limited_tracker
from ftcc.airside.elements.neighbours import disagreement
from ftcc.airside.elements.networks import adaptation_rate, grid_axis_energy, learned_gain
from ftcc.airside.elements.nonlinear import clip, limited
from ftcc.airside.elements.observers import sliding_mode_observer, unexplained_acceleration
from ftcc.airside.elements.performance import performance_transform, performance_tube
from ftcc.airside.elements.saturation import auxiliary_step
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.scheme import Flight, Heard, Problem, Quantity, Reference, quantities
from ftcc.airside.vocabulary import ALTITUDE_MOTION, ELEVATOR_WANTED
from ftcc.link.compiled import compiled
from ftcc.link.graph import Assumption

__all__ = ["Gains", "Output", "State", "check", "observe", "share", "start", "step"]

Q = Quantity


class Gains(NamedTuple):
    """Design parameters (table 3.3), then switches (0 or 1) and settings of the additions."""

    k11: Annotated[float, Q("k11", "N s/m", "speed error", 186.0)]
    k12: Annotated[float, Q("k12", "N/m", "integral of the speed error", 45.0)]
    k13: Annotated[float, Q("k13", "N s^2/m", "acceleration", 0.8)]
    beta1: Annotated[float, Q("beta_1", "1/s", "distributed observer, linear", 8.0)]
    beta2: Annotated[float, Q("beta_2", "m/s", "distributed observer, sliding mode", 4.0)]
    phi: Annotated[float, Q("phi", "m", "boundary layer of the distributed observer", 0.1)]
    tube_first: Annotated[float, Q("epsilon(0)", "m", "half-width of the tube at the start", 2.0)]
    tube_last: Annotated[float, Q("epsilon(inf)", "m", "half-width of the tube in the end", 0.45)]
    tube_decay: Annotated[float, Q("epsilon decay", "1/s", "decay of the tube", 0.3)]
    kl: Annotated[float, Q("k_l", "-", "lower wall of the tube", 1.0)]
    ku: Annotated[float, Q("k_u", "-", "upper wall of the tube", 1.0)]
    k21: Annotated[float, Q("k21", "m/s", "transformed altitude error", 1.5)]
    tau1: Annotated[float, Q("tau_1", "s", "filter of the flight-path command", 0.05)]
    k31: Annotated[float, Q("k31", "1/s", "flight-path error", 2.72)]
    w21: Annotated[float, Q("w21", "-", "network of the flight path", 1.06)]
    w22: Annotated[float, Q("w22", "-", "approximation error of the flight path", 2.5)]
    w23: Annotated[float, Q("w23", "-", "filter error of the flight path", 4.0)]
    g11: Annotated[float, Q("g11", "-", "adaptation rate of the flight path", 18.0)]
    w24: Annotated[float, Q("w24", "-", "leak of the flight path", 0.06)]
    tau2: Annotated[float, Q("tau_2", "s", "filter of the pitch command", 0.05)]
    k41: Annotated[float, Q("k41", "1/s", "pitch error", 3.15)]
    tau3: Annotated[float, Q("tau_3", "s", "filter of the pitch-rate command", 0.05)]
    k51: Annotated[float, Q("k51", "1/s", "pitch-rate error", 15.0)]
    w41: Annotated[float, Q("w41", "-", "network of the pitch rate", 2.0)]
    w42: Annotated[float, Q("w42", "-", "approximation error of the pitch rate", 2.71)]
    w43: Annotated[float, Q("w43", "-", "filter error of the pitch rate", 4.06)]
    g21: Annotated[float, Q("g21", "-", "adaptation rate of the pitch rate", 25.0)]
    w44: Annotated[float, Q("w44", "-", "leak of the pitch rate", 0.02)]
    k52: Annotated[float, Q("k52", "1/s", "auxiliary system", 3.0)]
    mu: Annotated[float, Q("mu", "rad", "threshold of the auxiliary system", 0.01)]
    network_filter: Annotated[float, Q("w_f", "rad/s", "low-pass that breaks the algebraic loop (chosen)", 20.0)]
    networks: Annotated[float, Q("networks", "-", "1: networks on", 1.0)]
    auxiliary: Annotated[float, Q("auxiliary", "-", "1: auxiliary system on", 1.0)]
    xi_term: Annotated[float, Q("X", "-", "1: the xi' term of the flight-path command on", 1.0)]
    inner: Annotated[float, Q("b_0", "1/s^2", "effectiveness by which the inner gain is divided (not in paper)", 1.0)]
    estimator: Annotated[float, Q("l_h", "1/s", "estimator of the pitch acceleration, 0: off (not in paper)", 0.0)]
    servo: Annotated[float, Q("w_s", "rad/s", "bandwidth of the estimator's servo model (not in paper)", 20.0)]
    lead_slow: Annotated[float, Q("lead", "s", "lead against the servo's lag (not in paper)", 0.03)]
    lead_fast: Annotated[float, Q("lead lag", "s", "its own lag, 0: no lead (not in paper)", 0.0)]
    observer_limit: Annotated[float, Q("w_max", "m/s", "limit of the observer's rate, 0: off (not in paper)", 0.0)]
    rate_filter: Annotated[float, Q("T_v", "s", "low-pass of the observer's rate, 0: off (not in paper)", 0.0)]
    smoother: Annotated[float, Q("w_r", "rad/s", "bandwidth of the reference smoother, 0: off (not in paper)", 0.0)]
    a_max: Annotated[float, Q("a_max", "m/s^2", "acceleration limit of the smoother (not in paper)", 1.5)]
    altitude_filter: Annotated[float, Q("l_z", "1/s", "complementary altitude filter, 0: off (not in paper)", 0.0)]
    gamma_limit: Annotated[float, Q("gamma_max", "rad", "limit of the flight-path command, 0: off (not in paper)", 0.0)]
    theta_limit: Annotated[float, Q("theta_max", "rad", "limit of the pitch command, 0: off (not in paper)", 0.0)]
    q_limit: Annotated[float, Q("q_max", "rad/s", "limit of the pitch-rate command, 0: off (not in paper)", 0.0)]
    cap: Annotated[float, Q("F_max", "-", "cap on the adapted parameters, 0: off (not in paper)", 0.0)]
    anti_windup: Annotated[float, Q("anti_windup", "-", "1: conditional integration of speed (not in paper)", 0.0)]
    horizon: Annotated[float, Q("horizon", "s", "longest extrapolation of a neighbour (not in paper)", 0.0)]
    in_flight: Annotated[float, Q("in_flight", "-", "1: estimates start at the own altitude; 0: at z_start", 0.0)]
    z_start: Annotated[
        float, Q("z_start", "m", "altitude at which the own estimate starts", 1000.0, follows="leaders.z")
    ]
    z_unheard: Annotated[
        float, Q("z_unheard", "m", "altitude assumed of a neighbour not heard yet", 1000.0, follows="leaders.z")
    ]


RANGES = {
    ranges.FEEDBACK: "k11 beta1 k21 k31 k41 k51 k52",
    ranges.COUPLING: "k12 k13 beta2",
    ranges.LAYER: "phi tube_first tube_last kl ku mu inner",
    ranges.FREQUENCY: "tube_decay network_filter servo",
    ranges.FILTER_TIME: "tau1 tau2 tau3",
    ranges.WEIGHT: "w21 w22 w23 w41 w42 w43",
    ranges.ADAPTATION: "g11 g21",
    ranges.LEAK: "w24 w44",
    ranges.SWITCH: "networks auxiliary xi_term anti_windup in_flight",
    ranges.OPTIONAL_FREQUENCY: "estimator smoother altitude_filter",
    ranges.OPTIONAL_TIME: "lead_slow lead_fast rate_filter",
    ranges.LIMIT: "a_max",
    ranges.LIMIT_OR_OFF: "observer_limit q_limit cap",
    ranges.ANGLE_LIMIT: "gamma_limit theta_limit",
    ranges.TIME: "horizon",
    ranges.ALTITUDE: "z_start z_unheard",
}


class State(NamedTuple):
    """Internal states of one follower."""

    z_d: Annotated[float, Q("z_d", "m", "estimated altitude of the leader")]
    gamma_d: Annotated[float, Q("gamma_d", "rad", "filtered flight-path command")]
    theta_d: Annotated[float, Q("theta_d", "rad", "filtered pitch command")]
    q_d: Annotated[float, Q("q_d", "rad/s", "filtered pitch-rate command")]
    F_gamma: Annotated[float, Q("F_gamma", "-", "adapted parameter of the flight path")]
    F_q: Annotated[float, Q("F_q", "-", "adapted parameter of the pitch rate")]
    zeta: Annotated[float, Q("zeta", "rad", "auxiliary system")]
    integral: Annotated[float, Q("I", "m", "integral of the speed error")]
    theta_f: Annotated[float, Q("theta_f", "rad", "low-pass of the pitch angle")]
    theta_f_rate: Annotated[float, Q("theta_f'", "rad/s", "its rate")]
    u_f: Annotated[float, Q("u_f", "rad", "low-pass of the control")]
    u_f_rate: Annotated[float, Q("u_f'", "rad/s", "its rate")]
    z_h: Annotated[float, Q("z_h", "m", "filtered altitude")]
    v_f: Annotated[float, Q("v_f", "m/s", "low-pass of the observer's rate")]
    z_r: Annotated[float, Q("z_r", "m", "smoothed reference")]
    v_r: Annotated[float, Q("v_r", "m/s", "its rate")]
    q_h: Annotated[float, Q("q_h", "rad/s", "estimator of the pitch acceleration")]
    u_s: Annotated[float, Q("u_s", "rad", "its servo model")]
    u_l: Annotated[float, Q("u_l", "rad", "lead filter")]
    V_before: Annotated[float, Q("V_before", "m/s", "airspeed at the tick before")]
    t_start: Annotated[float, Q("t_start", "s", "start of the tube")]


class Output(NamedTuple):
    """One evaluation of the law: commands first, then virtual controls, errors and what the states' rates need."""

    thrust: float
    elevator: float
    elevator_wanted: float
    speed_error: float
    z_d_rate: float
    v_ref: float
    error: float
    width: float
    transformed: float
    gamma_bar: float
    theta_bar: float
    q_bar: float
    E3: float
    E4: float
    E5: float
    energy_gamma: float
    energy_q: float
    unexplained: float
    q_h_rate: float
    u_before_lead: float
    lead_rate: float


SHARED = {
    "follower": (
        Q("zhat", "m", "estimated altitude of the leader"),
        Q("v", "m/s", "rate of the reference", rate_of="zhat"),
    ),
    "leader": ALTITUDE_MOTION,
}
_S = quantities(State)
SIGNALS = (
    Q("zhat", "m", "estimated altitude of the leader"),
    Q("z_r", "m", "altitude reference that the law tracks"),
    Q("z_h", "m", "altitude as the law sees it"),
    Q("e2", "m", "altitude error that the tube bounds", bound="epsilon"),
    Q("epsilon", "m", "half-width of the tube"),
    Q("E2", "-", "transformed altitude error"),
    *(_S[name] for name in ("gamma_d", "theta_d", "q_d", "F_gamma", "F_q", "zeta")),
    Q("unexplained", "rad/s^2", "pitch acceleration that the control does not explain"),
    ELEVATOR_WANTED,
)
TRACKING = (Q("z - z_d", "m", "altitude off the leader's", bound=2.0),)
GRAPH = Assumption.ONE_LEADER_UNDIRECTED
COMMANDS = ("thrust", "elevator")
PLANT = "longitudinal"
FORMS = {
    "monograph": {"tau1": 0.15},
    "flight": {
        "tau1": 0.25,
        "xi_term": 0.0,
        "inner": 17.0,
        "estimator": 20.0,
        "lead_fast": 0.015,
        "observer_limit": 3.0,
        "rate_filter": 0.5,
        "smoother": 1.0,
        "altitude_filter": 2.0,
        "gamma_limit": 0.2,
        "theta_limit": 0.3,
        "q_limit": 0.6,
        "cap": 0.5,
        "anti_windup": 1.0,
        "horizon": 5.0,
    },
}
SWITCHES = {
    "fault_tolerance": {"estimator": 0.0, "networks": 0.0, "auxiliary": 0.0},
    "networks": {"networks": 0.0, "auxiliary": 0.0},
    "estimator": {"estimator": 0.0},
    "lead": {"lead_fast": 0.0},
    "smoother": {"smoother": 0.0},
}

_LEAST_AIRSPEED = 5.0
"""Airspeed guard in every division, m/s."""

# The networks, all chosen: what counts as 0 and as 1 in an input; nodes per axis and their width.
_CRUISE, _SPEED_SCALE = 30.0, 3.0
"""m/s."""
_ANGLE_SCALE, _RATE_SCALE, _ELEVATOR_SCALE = 0.1, 0.5, 0.87
"""Flight path and pitch rad, pitch rate rad/s, elevator rad."""
_PATH_NODES, _PATH_WIDTH = 3, 2.0
"""Of the flight path's network."""
_RATE_NODES, _RATE_WIDTH = 2, 3.0
"""Of the pitch rate's network."""


@compiled
def _evaluate(s, own, total, V_rate, reference, model, gains):
    """Eqs. (3.7)-(3.57) for the states ``s`` as they stand; ``total`` is the disagreement with the neighbours."""
    V, gamma = own.V, own.gamma
    divisor = max(V, _LEAST_AIRSPEED)
    climb = V * gamma

    # Speed (3.7).
    speed_error = reference.V - V
    thrust = clip(
        gains.k11 * speed_error + gains.k12 * s.integral - gains.k13 * V_rate, model.thrust_min, model.thrust_max
    )

    # Distributed observer (3.20), and the reference that the tracking law follows.
    z_d_rate, _ = sliding_mode_observer(total, gains.beta1, gains.beta2, gains.phi)
    z_d_rate = limited(z_d_rate, gains.observer_limit)
    z_ref, v_ref = s.z_d, z_d_rate
    if gains.smoother > 0.0:
        z_ref, v_ref = s.z_r, s.v_r
    elif gains.rate_filter > 0.0:
        v_ref = s.v_f
    z_m = s.z_h if gains.altitude_filter > 0.0 else own.z

    # Performance transform (3.25)-(3.29).
    width, width_rate = performance_tube(own.t - s.t_start, gains.tube_first, gains.tube_last, gains.tube_decay)
    error = z_m - z_ref
    share_used, transformed, slope, slope_rate = performance_transform(
        error, climb - v_ref, width, width_rate, gains.kl, gains.ku
    )

    # Step 1: altitude (3.30), (3.31).
    drift = gains.xi_term * slope_rate / (2.0 * slope * slope)
    gamma_bar = (-(gains.k21 - drift) * transformed + v_ref + share_used * width_rate) / divisor
    gamma_bar = limited(gamma_bar, gains.gamma_limit)
    gamma_d_rate = first_order_rate(s.gamma_d, gamma_bar, gains.tau1)

    # Step 2: flight path (3.38)-(3.40).
    E3 = gamma - s.gamma_d
    speed, path = (V - _CRUISE) / _SPEED_SCALE, gamma / _ANGLE_SCALE
    energy_gamma = gains.networks * (
        grid_axis_energy(speed, _PATH_NODES, _PATH_WIDTH)
        * grid_axis_energy(path, _PATH_NODES, _PATH_WIDTH)
        * grid_axis_energy(s.theta_f / _ANGLE_SCALE, _PATH_NODES, _PATH_WIDTH)
    )
    gain = (
        gains.k31
        + learned_gain(s.F_gamma, energy_gamma, gains.w21)
        + 0.5 / (gains.w22 * gains.w22)
        + 0.5 / (gains.w23 * gains.w23)
    )
    theta_bar = limited(-gain * E3 + gamma_d_rate, gains.theta_limit)
    theta_d_rate = first_order_rate(s.theta_d, theta_bar, gains.tau2)

    # Step 3: pitch (3.49), (3.50).
    E4 = own.theta - s.theta_d
    q_bar = limited(-gains.k41 * E4 + theta_d_rate, gains.q_limit)
    q_d_rate = first_order_rate(s.q_d, q_bar, gains.tau3)

    # Step 4: pitch rate (3.54)-(3.57); positive u pitches up.
    E5 = own.q - s.q_d
    energy_q = gains.networks * (
        grid_axis_energy(speed, _RATE_NODES, _RATE_WIDTH)
        * grid_axis_energy(path, _RATE_NODES, _RATE_WIDTH)
        * grid_axis_energy(own.theta / _ANGLE_SCALE, _RATE_NODES, _RATE_WIDTH)
        * grid_axis_energy(own.q / _RATE_SCALE, _RATE_NODES, _RATE_WIDTH)
        * grid_axis_energy(s.u_f / _ELEVATOR_SCALE, _RATE_NODES, _RATE_WIDTH)
    )
    gain = (
        gains.k51
        + learned_gain(s.F_q, energy_q, gains.w41)
        + 0.5 / (gains.w42 * gains.w42)
        + 0.5 / (gains.w43 * gains.w43)
    )
    unexplained, q_h_rate = unexplained_acceleration(gains.estimator, own.q, s.q_h, gains.inner * s.u_s)
    u_before_lead = (-gain * E5 + q_d_rate - unexplained) / gains.inner + gains.auxiliary * gains.k52 * s.zeta
    u_wanted, lead_rate = u_before_lead, 0.0
    if gains.lead_fast > 0.0:
        u_wanted, lead_rate = lead_filter(s.u_l, u_before_lead, gains.lead_slow, gains.lead_fast)
    u = clip(u_wanted, -model.elevator_max, -model.elevator_min)
    return Output(
        thrust=thrust, elevator=-u, elevator_wanted=-u_wanted,
        speed_error=speed_error, z_d_rate=z_d_rate, v_ref=v_ref, error=error, width=width, transformed=transformed,
        gamma_bar=gamma_bar, theta_bar=theta_bar, q_bar=q_bar, E3=E3, E4=E4, E5=E5,
        energy_gamma=energy_gamma, energy_q=energy_q,
        unexplained=unexplained, q_h_rate=q_h_rate, u_before_lead=u_before_lead, lead_rate=lead_rate,
    )  # fmt: skip


@compiled
def _initial(own, z_d, gamma_d, theta_d, q_d, u_l):
    return State(
        z_d=z_d, gamma_d=gamma_d, theta_d=theta_d, q_d=q_d,
        F_gamma=0.0, F_q=0.0, zeta=0.0, integral=0.0,
        theta_f=own.theta, theta_f_rate=0.0, u_f=0.0, u_f_rate=0.0,
        z_h=own.z, v_f=0.0, z_r=z_d, v_r=0.0,
        q_h=own.q, u_s=-own.elevator, u_l=u_l, V_before=own.V, t_start=own.t,
    )  # fmt: skip


@compiled
def start(own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains) -> State:
    """State at the first tick: every filter at the value of what it filters, the neighbours agreeing."""
    z_d = own.z if gains.in_flight > 0.0 else gains.z_start
    gamma_d, theta_d, q_d, u_l = 0.0, 0.0, 0.0, 0.0
    # Each filtered command depends on those before it: after four passes the last one is right.
    for _ in range(4):
        law = _evaluate(_initial(own, z_d, gamma_d, theta_d, q_d, u_l), own, 0.0, 0.0, reference, model, gains)
        gamma_d, theta_d, q_d = law.gamma_bar, law.theta_bar, law.q_bar
        u_l = clip(law.u_before_lead, -model.elevator_max, -model.elevator_min)
    state: State = _initial(own, z_d, gamma_d, theta_d, q_d, u_l)
    return state


@compiled
def _capped(estimate: float, cap: float) -> float:
    return min(estimate, cap) if cap > 0.0 else estimate


@compiled
def step(state: State, own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains, dt: float):
    """One tick: the state ``dt`` later (one Euler step from the states as they stand), and the output."""
    s = state
    total, _, _ = disagreement(s.z_d, heard, 0.0, gains.horizon, gains.z_unheard, gains.in_flight)
    V_rate = (own.V - s.V_before) / dt
    law = _evaluate(s, own, total, V_rate, reference, model, gains)

    integral_rate = law.speed_error
    if gains.anti_windup > 0.0 and (
        (law.thrust >= model.thrust_max and law.speed_error > 0.0)
        or (law.thrust <= model.thrust_min and law.speed_error < 0.0)
    ):
        integral_rate = 0.0
    v_f_rate, z_r_rate, v_r_rate, z_h_rate = 0.0, 0.0, 0.0, 0.0
    if gains.rate_filter > 0.0:
        v_f_rate = first_order_rate(s.v_f, law.z_d_rate, gains.rate_filter)
    if gains.smoother > 0.0:
        z_r_rate, v_r_rate = limited_tracker(s.z_r, s.v_r, s.z_d, s.v_f, gains.smoother, gains.a_max)
    if gains.altitude_filter > 0.0:
        z_h_rate = complementary_rate(s.z_h, own.V * own.gamma, own.z, gains.altitude_filter)
    theta_f_rate, theta_f_acceleration = butterworth(s.theta_f, s.theta_f_rate, own.theta, gains.network_filter)
    u_f_rate, u_f_acceleration = butterworth(s.u_f, s.u_f_rate, -law.elevator, gains.network_filter)
    F_gamma_rate = adaptation_rate(s.F_gamma, law.E3, law.energy_gamma, gains.w21, gains.g11, gains.w24)
    F_q_rate = adaptation_rate(s.F_q, law.E5, law.energy_q, gains.w41, gains.g21, gains.w44)
    after = State(
        z_d=s.z_d + dt * law.z_d_rate,
        gamma_d=s.gamma_d + dt * first_order_rate(s.gamma_d, law.gamma_bar, gains.tau1),
        theta_d=s.theta_d + dt * first_order_rate(s.theta_d, law.theta_bar, gains.tau2),
        q_d=s.q_d + dt * first_order_rate(s.q_d, law.q_bar, gains.tau3),
        F_gamma=_capped(s.F_gamma + dt * F_gamma_rate, gains.cap),
        F_q=_capped(s.F_q + dt * F_q_rate, gains.cap),
        zeta=gains.auxiliary
        * auxiliary_step(s.zeta, gains.k52, law.E5, law.elevator_wanted - law.elevator, gains.mu, dt),
        integral=s.integral + dt * integral_rate,
        theta_f=s.theta_f + dt * theta_f_rate,
        theta_f_rate=s.theta_f_rate + dt * theta_f_acceleration,
        u_f=s.u_f + dt * u_f_rate,
        u_f_rate=s.u_f_rate + dt * u_f_acceleration,
        z_h=s.z_h + dt * z_h_rate,
        v_f=s.v_f + dt * v_f_rate,
        z_r=s.z_r + dt * z_r_rate,
        v_r=s.v_r + dt * v_r_rate,
        q_h=s.q_h + dt * law.q_h_rate,
        u_s=s.u_s + dt * gains.servo * (-law.elevator - s.u_s),
        u_l=s.u_l + dt * law.lead_rate,
        V_before=own.V,
        t_start=s.t_start,
    )
    return after, law


@compiled
def share(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values sent to the neighbours, at the time of ``state``, in the order of `SHARED`."""
    return state.z_d, output.v_ref


@compiled
def observe(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values of `SIGNALS`, at the time of ``state``."""
    z_r = state.z_r if gains.smoother > 0.0 else state.z_d
    z_h = state.z_h if gains.altitude_filter > 0.0 else own.z
    return (
        state.z_d, z_r, z_h, output.error, output.width, output.transformed,
        state.gamma_d, state.theta_d, state.q_d, state.F_gamma, state.F_q, state.zeta,
        output.unexplained, output.elevator_wanted,
    )  # fmt: skip


def climb_limit(gains: Gains) -> float:
    """Climb rate of the leader, m/s, that the estimates can just follow: that of the observer, and its limit."""
    return min(gains.beta2, gains.observer_limit) if gains.observer_limit > 0.0 else gains.beta2


def check(gains: Gains, flight: Flight) -> list[Problem]:
    """Conditions on the gains, from the chapter or from the sampling of the law."""
    problems = []
    if gains.tube_first < gains.tube_last:
        problems.append(Problem(True, "gain tube_first: the tube must not widen, epsilon(0) >= epsilon(inf)"))
    problems += above_leaders_climb(gains, "beta2", flight, "Theorem 3.1")
    if gains.observer_limit > 0.0:
        problems += above_leaders_climb(gains, "observer_limit", flight, "or the estimate cannot follow")
    if flight.leader_speed_varies:
        problems.append(
            Problem(True, "the leader's speed must be constant and the mission's, as which followers know it")
        )
    if gains.in_flight == 0.0:
        low, high = -gains.kl * gains.tube_first, gains.ku * gains.tube_first
        for uav, initial in flight.initial.items():
            error = initial.z - gains.z_start
            if not low < error < high:
                problems.append(
                    Problem(
                        True,
                        f"UAV {uav} starts at z = {initial.z:g} m, {error:+g} m from the estimate's start: outside "
                        f"of the performance tube {low:g} .. {high:g} m, eq. (3.24)",
                    )
                )
    for name in ("w24", "w44"):
        if getattr(gains, name) <= 0.5:
            problems.append(
                Problem(
                    False,
                    f"gain {name} = {getattr(gains, name):g}: not > 1/2, the sufficient condition (3.71); the "
                    "published values do not meet it either and fly",
                )
            )
    h = flight.period
    degree = largest_degree(flight)
    rates = {
        weighted("beta1, beta2 / phi", degree): degree * (gains.beta1 + gains.beta2 / gains.phi),
        "tau1": 1.0 / gains.tau1,
        "tau2": 1.0 / gains.tau2,
        "tau3": 1.0 / gains.tau3,
        "lead_fast": 1.0 / gains.lead_fast if gains.lead_fast > 0.0 else 0.0,
        "network_filter": gains.network_filter * math.sqrt(2.0),
        "estimator": gains.estimator,
        "servo": gains.servo,
    }
    problems += stable_in_steps(rates, h)
    if gains.inner == 1.0 and h > 0.001:
        problems.append(
            Problem(
                False,
                f"the printed inner loop (gain inner = 1) limit-cycles or diverges at {1.0 / h:.0f} Hz; it needs 1 kHz",
            )
        )
    return problems
