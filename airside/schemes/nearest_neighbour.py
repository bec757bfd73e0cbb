"""Distributed fault-tolerant tracking of the nearest neighbours under actuator fault and input saturation.

Source: Yu, Zhang, Jiang, Su: Fault-Tolerant Cooperative Control of Unmanned Aerial Vehicles, Springer 2024, sections
4.1-4.5; equation numbers are the monograph's. Each follower takes the weighted mean of its neighbours' motion (speed,
altitude and their rates) as its reference. It tracks this by dynamic surface control with disturbance observers, and
tolerates elevator faults, disturbances and saturation of thrust and elevator.

Departures from the printed law, each a gain that the `monograph` form leaves off:
- guards: limits on the virtual controls. Without them a large altitude error saturates the elevator for long, the
  auxiliary signal then pushes the pitch-rate reference further the wrong way, and the aircraft tumbles;
- a filter on the averages and k21 = 4: the printed law differentiates its reference three times through fast filters,
  so that held or late neighbour values destabilize the ring;
- neighbours extrapolated by the rates that they send, up to an age; older ones are left out of the average, and if none
  is left the last averages are held;
- an actuator lead, with observers fed by the modelled actuator positions: the printed gains do not tolerate the lag;
- q_d(0) = 0 in place of q_bar(0), which would give an initial pitch-rate estimate outside of the monograph's figure;
- the monograph's ideal measurement of a neighbour's acceleration is the sender's own estimate of it; what an ideal
  accelerometer adds (gain ``accelerometer``) is the part that its observer has not found yet.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from ftcc.airside import ranges
from ftcc.airside.conditions import stable_in_steps
from ftcc.airside.elements.actuators import leading_command, modelled_position
from ftcc.airside.elements.filters import first_order_rate, second_order_reference_step
from ftcc.airside.elements.neighbours import weighted_average
from ftcc.airside.elements.nonlinear import clip, limited
from ftcc.airside.elements.observers import disturbance_observer_rate
from ftcc.airside.elements.saturation import linear_auxiliary_rate
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model, airspeed_model, flight_path_model, pitch_rate_model
from ftcc.airside.scheme import Flight, Heard, Problem, Quantity, Reference, quantities
from ftcc.airside.vocabulary import ACCELERATED_MOTION, LONGITUDINAL_DISTURBANCES
from ftcc.link.compiled import compiled
from ftcc.link.graph import Assumption

__all__ = ["Gains", "Output", "State", "check", "observe", "share", "start", "step"]

Q = Quantity


class Gains(NamedTuple):
    """Design parameters, then switches (0 or 1) and settings of the additions."""

    k11: Annotated[float, Q("k11", "1/s", "observer of the speed disturbance", 5.0)]
    k12: Annotated[float, Q("k12", "1/s", "speed error", 20.0)]
    k21: Annotated[float, Q("k21", "1/s", "altitude error", 10.4)]
    k31: Annotated[float, Q("k31", "1/s", "observer of the flight-path disturbance", 6.4)]
    k32: Annotated[float, Q("k32", "1/s", "flight-path error", 2.2)]
    k42: Annotated[float, Q("k42", "1/s", "pitch error", 14.4)]
    k51: Annotated[float, Q("k51", "1/s", "observer of the lumped pitch disturbance", 46.6)]
    k52: Annotated[float, Q("k52", "1/s", "pitch-rate error", 39.4)]
    tau1: Annotated[float, Q("tau_1", "s", "filter of the flight-path command", 0.05)]
    tau2: Annotated[float, Q("tau_2", "s", "filter of the pitch command", 0.05)]
    tau3: Annotated[float, Q("tau_3", "s", "filter of the pitch-rate command", 0.05)]
    observers: Annotated[float, Q("observers", "-", "1: disturbance observers on", 1.0)]
    auxiliary: Annotated[float, Q("auxiliary", "-", "1: auxiliary systems on", 1.0)]
    accelerometer: Annotated[float, Q("accelerometer", "-", "1: the acceleration sent is an ideal measurement", 0.0)]
    gamma_limit: Annotated[float, Q("gamma_max", "rad", "limit of the flight-path command, 0: off (not in paper)", 0.0)]
    alpha_limit: Annotated[float, Q("alpha_max", "rad", "limit of theta_d - gamma, 0: off (not in paper)", 0.0)]
    q_limit: Annotated[float, Q("q_max", "rad/s", "limit of the pitch-rate command, 0: off (not in paper)", 0.0)]
    filter_frequency: Annotated[float, Q("w_r", "rad/s", "filter of the averages, 0: off (not in paper)", 0.0)]
    filter_damping: Annotated[float, Q("zeta_r", "-", "its damping (not in paper)", 1.5)]
    oldest: Annotated[float, Q("age_max", "s", "age at which a neighbour is left out (not in paper)", 2.0)]
    horizon: Annotated[float, Q("horizon", "s", "longest extrapolation of a neighbour (not in paper)", 2.0)]
    lead: Annotated[float, Q("lead", "rad/s", "apparent actuator bandwidth, 0: off (not in paper)", 0.0)]
    rate_filter: Annotated[float, Q("T_a", "s", "low-pass of the acceleration sent, 0: off (not in paper)", 0.0)]


RANGES = {
    ranges.FEEDBACK: "k11 k12 k21 k31 k32 k42 k51 k52",
    ranges.FILTER_TIME: "tau1 tau2 tau3",
    ranges.SWITCH: "observers auxiliary accelerometer",
    ranges.ANGLE_LIMIT: "gamma_limit alpha_limit",
    ranges.LIMIT_OR_OFF: "q_limit",
    ranges.OPTIONAL_FREQUENCY: "filter_frequency lead",
    ranges.DAMPING: "filter_damping",
    ranges.LIMIT: "oldest",
    ranges.TIME: "horizon",
    ranges.OPTIONAL_TIME: "rate_filter",
}


class State(NamedTuple):
    """Internal states of one follower."""

    x1: Annotated[float, Q("x1", "m/s^2", "observer of the speed disturbance")]
    x2: Annotated[float, Q("x2", "rad/s", "observer of the flight-path disturbance")]
    x3: Annotated[float, Q("x3", "rad/s^2", "observer of the lumped pitch disturbance")]
    gamma_d: Annotated[float, Q("gamma_d", "rad", "filtered flight-path command")]
    theta_d: Annotated[float, Q("theta_d", "rad", "filtered pitch command")]
    q_d: Annotated[float, Q("q_d", "rad/s", "filtered pitch-rate command")]
    xi1: Annotated[float, Q("xi1", "m/s", "auxiliary system of the thrust")]
    xi2: Annotated[float, Q("xi2", "rad/s", "auxiliary system of the elevator")]
    V_mean: Annotated[float, Q("V_id", "m/s", "neighbours' mean speed")]
    z_mean: Annotated[float, Q("z_id", "m", "neighbours' mean altitude")]
    V_r: Annotated[float, Q("V_r", "m/s", "filtered mean speed")]
    V_r_rate: Annotated[float, Q("V_r'", "m/s^2", "its rate")]
    z_r: Annotated[float, Q("z_r", "m", "filtered mean altitude")]
    z_r_rate: Annotated[float, Q("z_r'", "m/s", "its rate")]
    thrust: Annotated[float, Q("a_T", "N", "modelled thrust")]
    elevator: Annotated[float, Q("a_e", "rad", "modelled elevator position")]
    V_rate_f: Annotated[float, Q("a_f", "m/s^2", "low-pass of the acceleration sent")]
    V_before: Annotated[float, Q("V_before", "m/s", "airspeed at the tick before")]
    known_before: Annotated[float, Q("a_before", "m/s^2", "modelled acceleration at the tick before")]
    begun: Annotated[float, Q("begun", "-", "0 before the first tick, then 1")]


class Output(NamedTuple):
    """One evaluation of the law: commands first, then virtual controls, errors and the states' rates."""

    thrust: float
    elevator: float
    thrust_wanted: float
    elevator_wanted: float
    S1: float
    S2: float
    d1_hat: float
    d2_hat: float
    lumped_hat: float
    V_id: float
    z_id: float
    V_rate: float
    known_V_rate: float
    thrust_position: float
    elevator_position: float
    gamma_bar: float
    theta_bar: float
    gamma_d_rate: float
    theta_d_rate: float
    q_d_rate: float
    x1_rate: float
    x2_rate: float
    x3_rate: float
    xi1_rate: float
    xi2_rate: float


SHARED = {"follower": ACCELERATED_MOTION, "leader": ACCELERATED_MOTION}
_SPEED, _ALTITUDE = 0, 2
"""Columns of what is shared, each with its rate behind it."""
_S = quantities(State)
SIGNALS = (
    Q("V_id", "m/s", "neighbours' mean speed"),
    Q("z_id", "m", "neighbours' mean altitude"),
    Q("V_r", "m/s", "speed reference that the law tracks"),
    Q("z_r", "m", "altitude reference that the law tracks"),
    Q("S1", "m/s", "speed tracking error"),
    Q("S2", "m", "altitude tracking error"),
    *(_S[name] for name in ("gamma_d", "theta_d", "q_d", "xi1", "xi2")),
    *LONGITUDINAL_DISTURBANCES,
    Q("thrust_wanted", "N", "thrust before saturation"),
    Q("elevator_wanted", "rad", "elevator before saturation"),
)
TRACKING = (
    Q("z - z_d", "m", "altitude off the leader's", bound=2.0),
    Q("S1", "m/s", "speed tracking error", bound=1.0),
)
BRIEFED = True
"""The first tick already compares the own motion with the neighbours'."""
SWEEPS = 200
"""Most repetitions of an ideal exchange. The acceleration that a follower shares depends on those that it receives:
V' = P V' + ..., with eigenvalues of P inside the unit circle (0.83 on a ring of four)."""
GRAPH = Assumption.ONE_LEADER_UNDIRECTED
COMMANDS = ("thrust", "elevator")
PLANT = "longitudinal"
_GUARDS = {"gamma_limit": 0.3, "alpha_limit": 0.25, "q_limit": 2.0}
FORMS = {
    "monograph": {"accelerometer": 1.0},
    "flight": _GUARDS | {"k21": 4.0, "filter_frequency": 2.0, "lead": 100.0},
}
SWITCHES = {
    "fault_tolerance": {"observers": 0.0},
    "auxiliary": {"auxiliary": 0.0},
    "guards": {"gamma_limit": 0.0, "alpha_limit": 0.0, "q_limit": 0.0},
    "lead": {"lead": 0.0},
}

_LEAST_AIRSPEED = 5.0
"""Airspeed guard in every division, m/s."""


@compiled
def _evaluate(s, own, V_id, z_id, V_d, V_d_rate, z_d, z_d_rate, model, gains, dt):
    """Eqs. (4.16)-(4.50) for the states ``s`` as they stand and a reference (V_d, z_d) in speed and altitude."""
    V = own.V
    divisor = max(V, _LEAST_AIRSPEED)
    alpha = own.theta - own.gamma
    xi1 = gains.auxiliary * s.xi1
    xi2 = gains.auxiliary * s.xi2

    # Speed (4.16)-(4.19).
    f_v, g_v = airspeed_model(V, own.gamma, alpha, model)
    S1 = V - V_d
    d1_hat = gains.observers * (s.x1 + gains.k11 * S1)
    thrust_wanted = (-gains.k12 * S1 - f_v - d1_hat + 0.5 * gains.k12 * xi1 + V_d_rate) / g_v
    thrust = clip(thrust_wanted, model.thrust_min, model.thrust_max)

    # Altitude (4.23), (4.24).
    S2 = own.z - z_d
    gamma_bar = limited((-gains.k21 * S2 + z_d_rate) / divisor, gains.gamma_limit)
    gamma_d_rate = first_order_rate(s.gamma_d, gamma_bar, gains.tau1)

    # Flight path (4.30)-(4.32).
    f_g, g_g = flight_path_model(V, own.gamma, divisor, model)
    S3 = own.gamma - s.gamma_d
    d2_hat = gains.observers * (s.x2 + gains.k31 * S3)
    theta_bar = (-gains.k32 * S3 - f_g - d2_hat + gamma_d_rate) / g_g
    theta_bar = own.gamma + limited(theta_bar - own.gamma, gains.alpha_limit)
    theta_d_rate = first_order_rate(s.theta_d, theta_bar, gains.tau2)

    # Pitch (4.40), (4.41).
    S4 = own.theta - s.theta_d
    q_bar = limited(-gains.k42 * S4 + theta_d_rate - xi2, gains.q_limit)
    q_d_rate = first_order_rate(s.q_d, q_bar, gains.tau3)

    # Pitch rate (4.48)-(4.50).
    f_q, g_q = pitch_rate_model(V, alpha, own.q, divisor, model)
    S5 = own.q - s.q_d
    lumped_hat = gains.observers * (s.x3 + gains.k51 * S5)
    elevator_wanted = (-gains.k52 * S5 - f_q - lumped_hat + q_d_rate) / g_q
    elevator = clip(elevator_wanted, model.elevator_min, model.elevator_max)

    # The commands that move lagging actuators, from where they will be when the commands come into force; the observers
    # see where the actuators are.
    acting_thrust, acting_elevator = thrust, elevator
    sent_thrust, sent_elevator = thrust, elevator
    thrust_position, elevator_position = s.thrust, s.elevator
    if gains.lead > 0.0 and model.lag > 0.0:
        acting_thrust, acting_elevator = s.thrust, s.elevator
        thrust_position = modelled_position(s.thrust, own.thrust, model.lag, dt)
        elevator_position = modelled_position(s.elevator, own.elevator, model.lag, dt)
        sent_thrust = leading_command(thrust_position, thrust, model.lag, gains.lead)
        sent_elevator = leading_command(elevator_position, elevator, model.lag, gains.lead)
        sent_thrust = clip(sent_thrust, model.thrust_min, model.thrust_max)
        sent_elevator = clip(sent_elevator, model.elevator_min, model.elevator_max)

    # The acceleration sent to the neighbours.
    known_V_rate = f_v + g_v * acting_thrust
    V_rate = known_V_rate + d1_hat
    if gains.accelerometer > 0.0:
        V_rate = known_V_rate + ((own.V - s.V_before) / dt - s.known_before)
    elif gains.rate_filter > 0.0:
        V_rate = s.V_rate_f
    return Output(
        thrust=sent_thrust, elevator=sent_elevator, thrust_wanted=thrust_wanted, elevator_wanted=elevator_wanted,
        S1=S1, S2=S2, d1_hat=d1_hat, d2_hat=d2_hat, lumped_hat=lumped_hat,
        V_id=V_id, z_id=z_id, V_rate=V_rate, known_V_rate=known_V_rate,
        thrust_position=thrust_position, elevator_position=elevator_position,
        gamma_bar=gamma_bar, theta_bar=theta_bar,
        gamma_d_rate=gamma_d_rate, theta_d_rate=theta_d_rate, q_d_rate=q_d_rate,
        x1_rate=disturbance_observer_rate(gains.k11, S1, s.x1, f_v + g_v * acting_thrust, V_d_rate),
        x2_rate=disturbance_observer_rate(gains.k31, S3, s.x2, f_g + g_g * own.theta, gamma_d_rate),
        x3_rate=disturbance_observer_rate(gains.k51, S5, s.x3, f_q + g_q * acting_elevator, q_d_rate),
        xi1_rate=linear_auxiliary_rate(s.xi1, 0.5 * gains.k12, g_v, thrust, thrust_wanted),
        xi2_rate=linear_auxiliary_rate(s.xi2, gains.k52, g_q, elevator, elevator_wanted),
    )  # fmt: skip


@compiled
def _initial(own, V, V_rate, z, z_rate, gamma_d, theta_d, begun):
    return State(
        x1=0.0, x2=0.0, x3=0.0,
        gamma_d=gamma_d, theta_d=theta_d, q_d=0.0, xi1=0.0, xi2=0.0,
        V_mean=V, z_mean=z, V_r=V, V_r_rate=V_rate, z_r=z, z_r_rate=z_rate,
        thrust=own.thrust, elevator=own.elevator,
        V_rate_f=0.0, V_before=own.V, known_before=0.0, begun=begun,
    )  # fmt: skip


@compiled
def start(own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains) -> State:
    """State before the first tick; the first step sets the filters."""
    state: State = _initial(own, V=own.V, V_rate=0.0, z=own.z, z_rate=0.0, gamma_d=0.0, theta_d=0.0, begun=0.0)
    return state


@compiled
def step(state: State, own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains, dt: float):
    """One tick: the state ``dt`` later (one Euler step from the states as they stand), and the output.

    At the first tick the filters are set: that of the reference at the neighbours' mean, those of the commands at what
    they filter. A UAV that has heard no neighbour takes its own speed and altitude as their mean.
    """
    s = state
    # Nearest-neighbour reference (4.10), (4.11).
    V_id, V_id_rate, weights = weighted_average(heard, _SPEED, gains.oldest, gains.horizon)
    z_id, z_id_rate, z_weights = weighted_average(heard, _ALTITUDE, gains.oldest, gains.horizon)
    if weights == 0.0:
        V_id = s.V_mean
    if z_weights == 0.0:
        z_id = s.z_mean
    beginning = s.begun == 0.0
    V_d, V_d_rate, z_d, z_d_rate = V_id, V_id_rate, z_id, z_id_rate
    if gains.filter_frequency > 0.0 and not beginning:
        w, damping = gains.filter_frequency, gains.filter_damping
        V_d, V_d_rate = second_order_reference_step(s.V_r, s.V_r_rate, V_id, V_id_rate, w, damping, dt)
        z_d, z_d_rate = second_order_reference_step(s.z_r, s.z_r_rate, z_id, z_id_rate, w, damping, dt)
    gamma_d, theta_d = 0.0, 0.0
    # Beginning takes three passes: the pitch command depends on the filtered flight-path command.
    for _ in range(3 if beginning else 1):
        if beginning:
            s = _initial(
                own, V=V_id, V_rate=V_id_rate, z=z_id, z_rate=z_id_rate, gamma_d=gamma_d, theta_d=theta_d, begun=1.0
            )
        law = _evaluate(s, own, V_id, z_id, V_d, V_d_rate, z_d, z_d_rate, model, gains, dt)
        gamma_d, theta_d = law.gamma_bar, law.theta_bar

    V_rate_f = s.V_rate_f
    if gains.rate_filter > 0.0:
        V_rate_f += dt * first_order_rate(s.V_rate_f, law.known_V_rate + law.d1_hat, gains.rate_filter)
    after = State(
        x1=s.x1 + dt * law.x1_rate,
        x2=s.x2 + dt * law.x2_rate,
        x3=s.x3 + dt * law.x3_rate,
        gamma_d=s.gamma_d + dt * law.gamma_d_rate,
        theta_d=s.theta_d + dt * law.theta_d_rate,
        q_d=s.q_d + dt * law.q_d_rate,
        xi1=s.xi1 + dt * law.xi1_rate,
        xi2=s.xi2 + dt * law.xi2_rate,
        V_mean=V_id,
        z_mean=z_id,
        V_r=V_d,
        V_r_rate=V_d_rate,
        z_r=z_d,
        z_r_rate=z_d_rate,
        thrust=law.thrust_position,
        elevator=law.elevator_position,
        V_rate_f=V_rate_f,
        V_before=own.V,
        known_before=law.known_V_rate,
        begun=1.0,
    )
    return after, law


@compiled
def share(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values sent to the neighbours, at the time of ``state``, in the order of `SHARED`."""
    return own.V, output.V_rate, own.z, own.V * math.sin(own.gamma)


@compiled
def observe(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values of `SIGNALS`, at the time of ``state``."""
    V_tracked, z_tracked = own.V - output.S1, own.z - output.S2
    return (
        output.V_id, output.z_id, V_tracked, z_tracked, output.S1, output.S2,
        state.gamma_d, state.theta_d, state.q_d, state.xi1, state.xi2,
        output.d1_hat, output.d2_hat, output.lumped_hat,
        output.thrust_wanted, output.elevator_wanted,
    )  # fmt: skip


def check(gains: Gains, flight: Flight) -> list[Problem]:
    """Conditions on the gains, from the chapter or from the sampling of the law."""
    problems = []
    if gains.k32 < 5.9:
        problems.append(
            Problem(
                False,
                f"gain k32 = {gains.k32:g} 1/s: condition (4.63) asks for more than g_gamma + 1, about 5.9 at 30 m/s; "
                "the published value does not meet it either and flies",
            )
        )
    h = flight.period
    rates = {
        "k11, k12": gains.k11 + gains.k12,
        "k31": gains.k31,
        "k51, k52": gains.k51 + gains.k52,
        "tau1": 1.0 / gains.tau1,
        "tau2": 1.0 / gains.tau2,
        "tau3": 1.0 / gains.tau3,
    }
    problems += stable_in_steps(rates, h)
    if h > 0.01:
        problems.append(
            Problem(False, f"control rate {1.0 / h:.0f} Hz: the pitch-rate loop needs 100 Hz, its claims 200 Hz")
        )
    if gains.filter_frequency == 0.0 and flight.exchange_period > 0.01:
        problems.append(
            Problem(
                False,
                "without the filter of the averages (gain filter_frequency) the ring is unstable for neighbours at "
                f"less than 100 Hz; they are heard at {1.0 / flight.exchange_period:.0f} Hz",
            )
        )
    oldest = flight.exchange_period + flight.latency
    if oldest >= gains.oldest:
        problems.append(
            Problem(
                True,
                f"gain oldest = {gains.oldest:g} s: must exceed the exchange period plus the latency, {oldest:g} s, or "
                "records are too old when the next ones come",
            )
        )
    return problems
