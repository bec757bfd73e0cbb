"""Decentralized attitude synchronization with prescribed performance.

Source: Yu, Zhang, Jiang, Su: Fault-Tolerant Cooperative Control of Unmanned Aerial Vehicles, Springer 2024, chapter 7;
equation numbers are the monograph's. Each UAV tracks its own references of bank, angle of attack and sideslip, and
keeps its tracking errors close to those of its neighbours, inside a decaying funnel. The law tolerates faults of all
three surfaces and errors of the aerodynamic coefficients. There is no leader.

The networks' inputs, centres and widths are chosen: the monograph gives none. sign() is tanh(./phi_s). The `monograph`
form is the printed law. Departures of the `flight` form, each a gain that the other leaves off:
- neighbours' errors are held between messages and pass a critically damped filter; its rate replaces the sent one;
- feed-forward of the attitude's rate that the kinematics do not explain;
- an observer of the angular acceleration that the nominal model does not explain;
- caps on the gains that the adaptive terms add: the sampled loop cannot follow larger ones;
- a weaker coupling of the attitude errors into the auxiliary system of the rates;
- a lead on the surfaces' commands against their lag.

The differentiator is integrated in sub-steps over the last tick; its input is a ramp from sample to sample.
`dynamic_surface` = 1 is the traditional law that the monograph compares with: a first-order filter, without funnel and
without adaptive, auxiliary and finite-time terms. The file is longer than others: it holds two laws, and each part of a
step is a function.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside import ranges
from ftcc.airside.attitude_model import (
    attitude_error,
    attitude_of,
    body_rate_model,
    body_rates_of,
    deflections_for,
    kinematics,
    kinematics_inverse,
    largest_deflections,
    least_deflections,
    reference_rates_of,
    surfaces_of,
)
from ftcc.airside.conditions import bounds_errors, stable_in_steps
from ftcc.airside.elements.filters import butterworth_step, robust_exact_differentiator_on_ramp
from ftcc.airside.elements.neighbours import error_sums, filtered_error_sums
from ftcc.airside.elements.networks import (
    adaptation_rate,
    diagonal_energy,
    grid_axis_energy,
    learned_gain,
    network_inputs,
)
from ftcc.airside.elements.nonlinear import clip, smooth_powers, smooth_signs
from ftcc.airside.elements.observers import discrete_disturbance_observer_steps
from ftcc.airside.elements.performance import bounded_transforms, performance_tube
from ftcc.airside.elements.vectors import (
    added,
    applied,
    applied_transposed,
    dot,
    limited_to,
    over,
    scaled,
    subtracted,
    times,
    turned,
)
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.references.attitude import Reference
from ftcc.airside.scheme import Flight, Heard, Problem, Quantity
from ftcc.airside.vocabulary import ATTITUDE_TRACKING, angles, body_rates, surfaces
from ftcc.link.compiled import Room, Vector, compiled
from ftcc.link.graph import Assumption

__all__ = ["Gains", "Output", "State", "check", "observe", "share", "start", "step"]

Q = Quantity

MOST_NEIGHBOURS = 16
"""Largest number of neighbours whose errors a UAV can filter."""


class Gains(NamedTuple):
    """Design parameters, then switches (0 or 1) and settings of the additions."""

    lambda1: Annotated[float, Q("lambda_1", "-", "own tracking error", 1.2)]
    lambda2: Annotated[float, Q("lambda_2", "-", "differences to the neighbours' errors", 1.0)]
    k_up: Annotated[float, Q("k_up", "-", "upper wall of the funnel", 1.1)]
    k_lo: Annotated[float, Q("k_lo", "-", "lower wall of the funnel", 1.1)]
    eps0: Annotated[float, Q("eps_0", "rad", "funnel at the start", 0.4)]
    eps_inf: Annotated[float, Q("eps_inf", "rad", "funnel at the end", 0.15)]
    nu: Annotated[float, Q("nu", "1/s", "decay of the funnel", 0.5)]
    k11_mu: Annotated[float, Q("K11", "1/s", "transformed error, bank", 3.0)]
    k11_alpha: Annotated[float, Q("K11", "1/s", "transformed error, alpha", 5.0)]
    k11_beta: Annotated[float, Q("K11", "1/s", "transformed error, sideslip", 1.5)]
    k12_mu: Annotated[float, Q("K12", "1/s", "finite-time term, bank", 0.5)]
    k12_alpha: Annotated[float, Q("K12", "1/s", "finite-time term, alpha", 0.25)]
    k12_beta: Annotated[float, Q("K12", "1/s", "finite-time term, sideslip", 0.2)]
    k21_p: Annotated[float, Q("K21", "1/s", "roll-rate error", 10.0)]
    k21_q: Annotated[float, Q("K21", "1/s", "pitch-rate error", 15.0)]
    k21_r: Annotated[float, Q("K21", "1/s", "yaw-rate error", 8.0)]
    k22_p: Annotated[float, Q("K22", "rad/s^2", "finite-time term, roll rate", 0.3)]
    k22_q: Annotated[float, Q("K22", "rad/s^2", "finite-time term, pitch rate", 2.5)]
    k22_r: Annotated[float, Q("K22", "rad/s^2", "finite-time term, yaw rate", 0.2)]
    upsilon: Annotated[float, Q("upsilon", "-", "exponent of the finite-time terms", 0.6)]
    h11: Annotated[float, Q("h11", "s^(1/2)", "scale of the first network", 2.5)]
    h12: Annotated[float, Q("h12", "s^(1/2)", "damping of the transformed error", 1.2)]
    h13: Annotated[float, Q("h13", "rad^(1/2)/s^(3/2)", "differentiator, damping", 63.25)]
    h14: Annotated[float, Q("h14", "s/rad", "differentiator, convergence from afar", 1.0)]
    h15: Annotated[float, Q("h15", "rad/s^3", "differentiator, bound of the second derivative", 2000.0)]
    h21: Annotated[float, Q("h21", "s^(1/2)", "scale of the second network", 2.0)]
    h22: Annotated[float, Q("h22", "s^(1/2)", "damping of the rate error", 1.3)]
    tau1: Annotated[float, Q("tau_1", "1/s", "sliding term of the first auxiliary system", 0.2)]
    tau2: Annotated[float, Q("tau_2", "rad/s^2", "sliding term of the second auxiliary system", 0.2)]
    k13: Annotated[float, Q("k13", "-", "adaptation of Theta_1, 0: off", 30.0)]
    k14: Annotated[float, Q("k14", "1/s", "leak of Theta_1", 0.05)]
    k23: Annotated[float, Q("k23", "-", "adaptation of Theta_2, 0: off", 30.0)]
    k24: Annotated[float, Q("k24", "1/s", "leak of Theta_2", 0.08)]
    phi_s: Annotated[float, Q("phi_s", "-", "boundary layer of sign() (chosen)", 0.002)]
    w_u: Annotated[float, Q("w_u", "rad/s", "low-pass of the command, input of the second network (chosen)", 20.0)]
    substeps: Annotated[float, Q("N", "-", "Euler steps per tick", 5.0)]
    edge: Annotated[float, Q("edge", "-", "share of the funnel with a linear transform beyond (not in paper)", 0.98)]
    neighbour_filter: Annotated[float, Q("w_f", "rad/s", "filter of neighbours, 0: none (not in paper)", 0.0)]
    oldest: Annotated[float, Q("oldest", "s", "age at which a neighbour is dropped, 0: held (not in paper)", 0.0)]
    feed_forward: Annotated[float, Q("feed_forward", "-", "1: kinematic feed-forward (not in paper)", 0.0)]
    observer: Annotated[float, Q("w_d", "rad/s", "observer of the body rates, 0: none (not in paper)", 0.0)]
    cap1: Annotated[float, Q("cap_1", "1/s", "largest added gain on attitude, 0: any (not in paper)", 0.0)]
    cap2: Annotated[float, Q("cap_2", "1/s", "largest added gain on rates, 0: any (not in paper)", 0.0)]
    k_zeta: Annotated[float, Q("k_zeta", "-", "coupling into the second auxiliary system (not in paper)", 1.0)]
    lag: Annotated[float, Q("lag", "rad/s", "surfaces' bandwidth that lead and observer assume, 0: none", 0.0)]
    dynamic_surface: Annotated[float, Q("dynamic_surface", "-", "1: the traditional law", 0.0)]


RANGES = {
    ranges.WEIGHT: "lambda1",
    ranges.COUPLING: "lambda2 tau1 tau2 k_zeta",
    ranges.LAYER: "k_up k_lo eps0 eps_inf h11 h12 h21 h22 phi_s",
    ranges.FREQUENCY: "nu w_u",
    ranges.FEEDBACK: "k11_mu k11_alpha k11_beta k21_p k21_q k21_r h13 h14 h15",
    ranges.FINITE_TIME: "k12_mu k12_alpha k12_beta k22_p k22_q k22_r",
    ranges.EXPONENT: "upsilon",
    ranges.ADAPTATION: "k13 k23",
    ranges.LEAK: "k14 k24",
    ranges.STEPS: "substeps",
    ranges.INNER_SHARE: "edge",
    ranges.OPTIONAL_FREQUENCY: "neighbour_filter observer lag",
    ranges.TIME: "oldest",
    ranges.SWITCH: "feed_forward dynamic_surface",
    ranges.LIMIT_OR_OFF: "cap1 cap2",
}


class State(NamedTuple):
    """Internal states of one UAV."""

    t: Annotated[float, Q("t", "s", "time of the last tick")]
    began: Annotated[float, Q("t_0", "s", "time of the first tick")]
    ticks: Annotated[float, Q("k", "-", "ticks done")]
    e: Annotated[Vector, Q("e", "rad", "tracking error of the last tick")]
    e_dot: Annotated[Vector, Q("e_dot", "rad/s", "its filtered rate")]
    F1: Annotated[Vector, Q("F1_hat", "rad/s", "kinematic feed-forward")]
    x2_bar: Annotated[Vector, Q("X2_bar", "rad/s", "virtual rate command of the last tick")]
    x2_d: Annotated[Vector, Q("X2_d", "rad/s", "differentiator: its value")]
    w: Annotated[Vector, Q("w", "rad/s^2", "differentiator: its rate")]
    z1: Annotated[Vector, Q("z_1", "-", "auxiliary system of the attitude")]
    z2: Annotated[Vector, Q("z_2", "rad/s", "auxiliary system of the rates")]
    theta1: Annotated[float, Q("Theta_1", "-", "squared norm of the first network's weights")]
    theta2: Annotated[float, Q("Theta_2", "-", "squared norm of the second network's weights")]
    u: Annotated[Vector, Q("U", "rad", "command of the last tick before the lead")]
    acting: Annotated[Vector, Q("U_act", "rad", "modelled position of the surfaces")]
    u_f: Annotated[Vector, Q("U_f", "rad", "low-passed command")]
    u_f_dot: Annotated[Vector, Q("U_f_dot", "rad/s", "its rate")]
    x2_hat: Annotated[Vector, Q("X2_hat", "rad/s", "observer of the body rates")]
    d: Annotated[Vector, Q("d_hat", "rad/s^2", "unexplained acceleration")]
    neighbours: Annotated[
        NDArray[np.float64],
        Q("e_j", "rad, rad/s", "per neighbour: heard before, filtered error and its rate"),
        Room((MOST_NEIGHBOURS, 7)),
    ]


class Output(NamedTuple):
    """Commands first, then the other results of one evaluation of the law."""

    aileron: float
    elevator: float
    rudder: float
    E: Vector
    """Synchronization error, rad."""
    eps: float
    """Funnel, rad."""
    F1: Vector
    x2_bar: Vector
    d: Vector
    wanted: Vector
    """Deflections before the limits, rad."""


SHARED = {
    "follower": (
        *angles("{}_error", "rad", "tracking error, {}"),
        *angles("{}_error_rate", "rad/s", "used without a neighbour filter only", rate_of="{}_error"),
    ),
    "leader": (),
}
CARRIES = False
SIGNALS = (
    *angles("{}_d", "rad", "reference, {}"),
    *angles("E_{}", "rad", "synchronization error, {}", bound="wall"),
    Q("wall", "rad", "upper wall of the funnel"),
    *body_rates("{}_d", "rad/s", "differentiated rate command, {}"),
    Q("theta1", "-", "squared norm of the first network's weights"),
    Q("theta2", "-", "squared norm of the second network's weights"),
    *body_rates("d_{}", "rad/s^2", "unexplained {} acceleration"),
    *surfaces("{}_wanted", "rad", "{} before its limits"),
)
TRACKING = ATTITUDE_TRACKING
GRAPH = Assumption.CONNECTED_UNDIRECTED
COMMANDS = ("aileron", "elevator", "rudder")
PLANT = "attitude"
FORMS = {
    "monograph": {},
    "flight": {
        "phi_s": 0.01,
        "substeps": 10.0,
        "edge": 0.9,
        "neighbour_filter": 10.0,
        "feed_forward": 1.0,
        "observer": 40.0,
        "cap1": 10.0,
        "cap2": 30.0,
        "k_zeta": 0.3,
        "lag": 20.0,
    },
}
SWITCHES = {
    "fault_tolerance": {"k13": 0.0, "k23": 0.0, "feed_forward": 0.0, "observer": 0.0},
    "adaptation": {"k13": 0.0, "k23": 0.0},
}

_LEAST_AIRSPEED = 3.0
"""Airspeed guard, m/s."""
_STEEPEST, _LOST = 42.0, 58.0
"""Largest phi / (k eps_inf) that was flown with success in both forms, and the least that was lost, 1/rad."""
_LARGEST_SIDESLIP = math.radians(80.0)
"""Sideslip guard in the kinematics, rad."""
_RATE_FILTER = 0.02
"""Time constant of the low-pass on the differentiated tracking error, s."""
_FEED_FORWARD_FILTER = 0.05
"""Time constant of the low-pass on the feed-forward, s."""
_DYNAMIC_SURFACE = 0.05
"""Time constant of the traditional law's filter, s."""
_FASTEST_OBSERVER, _SLOWEST_OBSERVER, _FASTEST_NEIGHBOURS = 0.4, 10.0, 20.0
"""Limits, see `_sampled_well`: share of the control rate; rad/s; rad/s."""
_FASTEST_LOW_PASS = math.sqrt(6.0) - math.sqrt(2.0)
"""w h at which the steps of (7.35) become unstable: 4 = 2 sqrt(2) w h + (w h)^2."""
_ZERO = (0.0, 0.0, 0.0)

# The networks, all chosen: what counts as 1 in an input, how far an input counts, and where the neurons are.
_ANGLE_SCALE = (0.3, 0.2, 0.1)
"""rad."""
_RATE_SCALE = (1.0, 1.0, 1.0)
"""rad/s."""
_COMMAND_SCALE = (0.6, 0.6, 0.6)
"""rad."""
_LARGEST_INPUT = 1.5
_ANGLE_NODES, _ANGLE_WIDTH = 3, 2.0
"""First network: nodes per axis of its grid, and their width."""
_RATE_NODES, _RATE_WIDTH = 61, 6.0
"""Second network: nodes on its diagonal, and their width."""


class _Error(NamedTuple):
    """Synchronization error of a tick, and its funnel."""

    E: Vector
    """(7.12), rad."""
    phi: float
    """Share of the own error in it: lambda1 + lambda2 sum_j a_ij."""
    neighbours: Vector
    """sum_j a_ij e_j', rad/s."""
    eps: float
    """Funnel (7.16), rad."""
    eps_rate: float
    xi: Vector
    """Transformed error (7.20)."""
    eta: Vector
    """Its slope, 1/rad."""


class _Nominal(NamedTuple):
    """The nominal model at the present attitude: X1' = F1 + G1 X2, X2' = F2 + G2 U."""

    G1: tuple[Vector, Vector, Vector]
    G1_inverse: tuple[Vector, Vector, Vector]
    F2: Vector
    G2: tuple[Vector, Vector, Vector]


@compiled
def _k11(gains):
    return gains.k11_mu, gains.k11_alpha, gains.k11_beta


@compiled
def _k12(gains):
    return gains.k12_mu, gains.k12_alpha, gains.k12_beta


@compiled
def _k21(gains):
    return gains.k21_p, gains.k21_q, gains.k21_r


@compiled
def _k22(gains):
    return gains.k22_p, gains.k22_q, gains.k22_r


@compiled
def start(own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains) -> State:
    """State at the first tick: the published zeros, the body rates as measured, the surfaces at their command."""
    return State(
        t=own.t, began=own.t, ticks=0.0,
        e=attitude_error(own, reference), e_dot=_ZERO, F1=_ZERO,
        x2_bar=_ZERO, x2_d=_ZERO, w=_ZERO,
        z1=_ZERO, z2=_ZERO, theta1=0.0, theta2=0.0,
        u=_ZERO, acting=surfaces_of(own), u_f=_ZERO, u_f_dot=_ZERO,
        x2_hat=body_rates_of(own), d=_ZERO,
        neighbours=0.0,  # type: ignore[arg-type]
    )  # fmt: skip


@compiled
def _capped(gain, cap):
    return min(gain, cap) if cap > 0.0 else gain


@compiled
def _synchronization_error(state, own, e, heard, gains, dt):
    """Synchronization error (7.12), funnel (7.16) and transformed error (7.20)."""
    if gains.neighbour_filter > 0.0:
        weights, differences, rates = filtered_error_sums(
            e, heard, state.neighbours, gains.neighbour_filter, gains.oldest, dt
        )
    else:
        weights, differences, rates = error_sums(e, heard, gains.oldest)
    E = added(scaled(gains.lambda1, e), scaled(gains.lambda2, differences))
    eps, eps_rate = performance_tube(own.t - state.began, gains.eps0, gains.eps_inf, gains.nu)
    xi, eta = bounded_transforms(E, eps, gains.k_lo, gains.k_up, gains.edge, 1.0)
    phi = gains.lambda1 + gains.lambda2 * weights
    return _Error(E=E, phi=phi, neighbours=rates, eps=eps, eps_rate=eps_rate, xi=xi, eta=eta)


@compiled
def _nominal(own, beta, model):
    """The model, with the airspeed and the sideslip ``beta`` (rad) guarded."""
    V = max(own.V, _LEAST_AIRSPEED)
    F2, G2 = body_rate_model(V, own.alpha, own.beta, body_rates_of(own), V, model)
    return _Nominal(G1=kinematics(own.alpha, beta), G1_inverse=kinematics_inverse(own.alpha, beta), F2=F2, G2=G2)


@compiled
def _acting_surfaces(state, own, gains, dt):
    """Modelled position of the surfaces; without a lag their command."""
    command = surfaces_of(own)
    if gains.lag > 0.0:
        return added(state.acting, scaled(1.0 - math.exp(-gains.lag * dt), subtracted(command, state.acting)))
    return command


@compiled
def _unexplained_acceleration(state, x2, nominal, acting, gains, dt):
    """Observer of the body rates, and the acceleration that the model does not explain."""
    if gains.observer == 0.0 or state.ticks == 0.0:
        return state.x2_hat, state.d
    explained = added(nominal.F2, applied(nominal.G2, acting))
    return discrete_disturbance_observer_steps(state.x2_hat, state.d, x2, explained, gains.observer, dt)


@compiled
def _feed_forward(state, e, x2, reference_rate, nominal, gains, dt):
    """Filtered rate of the tracking error, and the attitude's rate that the body rates do not explain."""
    e_dot, F1 = state.e_dot, state.F1
    if gains.feed_forward == 0.0:
        return e_dot, F1
    share_of_new = 1.0
    if state.ticks > 0.0:
        difference = scaled(1.0 / dt, turned(e, state.e))
        e_dot = added(e_dot, scaled(1.0 - math.exp(-dt / _RATE_FILTER), subtracted(difference, e_dot)))
        share_of_new = 1.0 - math.exp(-dt / _FEED_FORWARD_FILTER)
    seen = subtracted(added(e_dot, reference_rate), applied(nominal.G1, x2))
    return e_dot, added(F1, scaled(share_of_new, subtracted(seen, F1)))


@compiled
def _network_energies(own, u_f):
    """phi'phi of the two networks, each with a constant neuron."""
    mu, alpha, beta = network_inputs(attitude_of(own), _ANGLE_SCALE, _LARGEST_INPUT)
    energy = (
        grid_axis_energy(mu, _ANGLE_NODES, _ANGLE_WIDTH)
        * grid_axis_energy(alpha, _ANGLE_NODES, _ANGLE_WIDTH)
        * grid_axis_energy(beta, _ANGLE_NODES, _ANGLE_WIDTH)
    )
    rates = network_inputs(body_rates_of(own), _RATE_SCALE, _LARGEST_INPUT)
    inputs = (mu, alpha, beta, *rates, *network_inputs(u_f, _COMMAND_SCALE, _LARGEST_INPUT))
    return 1.0 + energy, 1.0 + diagonal_energy(inputs, _RATE_NODES, _RATE_WIDTH)


@compiled
def _rate_command(state, error, reference_rate, F1, nominal, energy, gains):
    """Virtual rate command X2_bar (7.23)."""
    S1 = subtracted(error.xi, state.z1)
    damping = learned_gain(state.theta1, energy, gains.h11) + 1.0 / (2.0 * gains.h12 * gains.h12)
    mu, alpha, beta = scaled(damping, times(error.eta, error.eta))
    added_gain = (_capped(mu, gains.cap1), _capped(alpha, gains.cap1), _capped(beta, gains.cap1))
    pull = added(times(_k11(gains), error.xi), times(added_gain, S1))
    pull = added(pull, times(_k12(gains), smooth_powers(S1, gains.upsilon, gains.phi_s)))
    wanted = subtracted(reference_rate, over(pull, error.eta))
    wanted = added(wanted, scaled(gains.lambda2 / error.phi, error.neighbours))
    wanted = subtracted(added(wanted, scaled(error.eps_rate / (error.eps * error.phi), error.E)), F1)
    return applied(nominal.G1_inverse, wanted)


@compiled
def _differentiated(state, x2_bar, gains, dt):
    """X2_d and w at this tick: (7.24) from the tick before, its input on a ramp."""
    if state.ticks == 0.0:
        return state.x2_d, state.w
    return robust_exact_differentiator_on_ramp(
        state.x2_d, state.w, state.x2_bar, x2_bar,
        gains.h13, gains.h14, gains.h15, gains.phi_s, dt, int(gains.substeps),
    )  # fmt: skip


@compiled
def _wanted_deflections(state, x2, x2_d, w, d, nominal, energy, gains):
    """Deflections U before their limits, and the rate error S2, (7.37)."""
    S2 = subtracted(subtracted(x2, x2_d), state.z2)
    damping = learned_gain(state.theta2, energy, gains.h21) + 1.0 / (2.0 * gains.h22 * gains.h22)
    pull = added(times(_k21(gains), subtracted(x2, x2_d)), d)
    pull = added(pull, times(_k22(gains), smooth_powers(S2, gains.upsilon, gains.phi_s)))
    pull = added(pull, scaled(_capped(damping, gains.cap2), S2))
    return deflections_for(nominal.G2, subtracted(subtracted(w, nominal.F2), pull)), S2


@compiled
def _adapted(state, error, S2, er, nominal, energy1, energy2, gains, dt):
    """z1, z2 (7.25), (7.38) and Theta_1, Theta_2 (7.34), (7.45) a tick later, in Euler steps; the rest is held."""
    z1, z2, theta1, theta2 = state.z1, state.z2, state.theta1, state.theta2
    phi, eta, G1 = error.phi, error.eta, nominal.G1
    parts = int(gains.substeps)
    h = dt / parts
    rate_error = math.sqrt(dot(S2, S2))
    for _ in range(parts):
        weighted = times(subtracted(error.xi, z1), eta)
        z1_rate = subtracted(times(eta, applied(G1, added(er, z2))), times(_k11(gains), z1))
        z1_rate = scaled(phi, subtracted(z1_rate, scaled(gains.tau1, smooth_signs(z1, gains.phi_s))))
        z2_rate = subtracted(scaled(phi * gains.k_zeta, applied_transposed(G1, weighted)), times(_k21(gains), z2))
        z2_rate = subtracted(z2_rate, scaled(gains.tau2, smooth_signs(z2, gains.phi_s)))
        attitude_norm = math.sqrt(dot(weighted, weighted))
        theta1 += h * adaptation_rate(theta1, attitude_norm, energy1, gains.h11, gains.k13, gains.k14)
        theta2 += h * adaptation_rate(theta2, rate_error, energy2, gains.h21, gains.k23, gains.k24)
        z1, z2 = added(z1, scaled(h, z1_rate)), added(z2, scaled(h, z2_rate))
    return z1, z2, theta1, theta2


@compiled
def _traditional(state, own, error, reference_rate, nominal, gains, dt):
    """Dynamic surface control without funnel, networks and auxiliary systems: X2_bar, X2_d and U before its limits."""
    wanted = added(
        subtracted(reference_rate, times(_k11(gains), error.E)), scaled(gains.lambda2 / error.phi, error.neighbours)
    )
    x2_bar = applied(kinematics_inverse(own.alpha, own.beta), wanted)
    x2_d = x2_bar
    if state.ticks > 0.0:
        x2_d = added(x2_bar, scaled(math.exp(-dt / _DYNAMIC_SURFACE), subtracted(state.x2_d, x2_bar)))
    acceleration = subtracted(scaled(1.0 / _DYNAMIC_SURFACE, subtracted(x2_bar, x2_d)), nominal.F2)
    acceleration = subtracted(acceleration, times(_k21(gains), subtracted(body_rates_of(own), x2_d)))
    return x2_bar, x2_d, deflections_for(nominal.G2, acceleration)


@compiled
def _sent(state, u, low, high, gains, dt):
    """The command ``u`` with a lead against the surfaces' lag, within the limits."""
    if gains.lag == 0.0 or state.ticks == 0.0:
        return u
    decay = math.exp(-gains.lag * dt)
    return limited_to(added(u, scaled(decay / (1.0 - decay), subtracted(u, state.u))), low, high)


@compiled
def step(state: State, own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains, dt: float):
    """One tick: the state ``dt`` seconds later, and the output now."""
    e, x2, reference_rate = attitude_error(own, reference), body_rates_of(own), reference_rates_of(reference)
    error = _synchronization_error(state, own, e, heard, gains, dt)
    nominal = _nominal(own, clip(own.beta, -_LARGEST_SIDESLIP, _LARGEST_SIDESLIP), model)
    acting = _acting_surfaces(state, own, gains, dt)
    x2_hat, d = _unexplained_acceleration(state, x2, nominal, acting, gains, dt)
    e_dot, F1 = _feed_forward(state, e, x2, reference_rate, nominal, gains, dt)

    if gains.dynamic_surface > 0.0:
        x2_bar, x2_d, wanted = _traditional(state, own, error, reference_rate, nominal, gains, dt)
        w, z1, z2, theta1, theta2 = state.w, state.z1, state.z2, state.theta1, state.theta2
    else:
        energy1, energy2 = _network_energies(own, state.u_f)
        x2_bar = _rate_command(state, error, reference_rate, F1, nominal, energy1, gains)
        x2_d, w = _differentiated(state, x2_bar, gains, dt)
        wanted, S2 = _wanted_deflections(state, x2, x2_d, w, d, nominal, energy2, gains)
        er = subtracted(x2_d, x2_bar)
        z1, z2, theta1, theta2 = _adapted(state, error, S2, er, nominal, energy1, energy2, gains, dt)

    # Limits, lead, and the low-passed command (7.35) that the second network sees next.
    low, high = least_deflections(model), largest_deflections(model)
    u = limited_to(wanted, low, high)
    sent = _sent(state, u, low, high, gains, dt)
    u_f, u_f_dot = butterworth_step(state.u_f, state.u_f_dot, sent, gains.w_u, dt)

    aileron, elevator, rudder = sent
    after = State(
        t=own.t, began=state.began, ticks=state.ticks + 1.0,
        e=e, e_dot=e_dot, F1=F1,
        x2_bar=x2_bar, x2_d=x2_d, w=w,
        z1=z1, z2=z2, theta1=theta1, theta2=theta2,
        u=u, acting=acting, u_f=u_f, u_f_dot=u_f_dot,
        x2_hat=x2_hat, d=d,
        neighbours=state.neighbours,
    )  # fmt: skip
    output = Output(
        aileron=aileron, elevator=elevator, rudder=rudder,
        E=error.E, eps=error.eps, F1=F1, x2_bar=x2_bar, d=d, wanted=wanted,
    )  # fmt: skip
    return after, output


@compiled
def share(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Own tracking error, and its rate: the difference to the tick before."""
    e = attitude_error(own, reference)
    since = own.t - state.t
    e_dot = scaled(1.0 / since, turned(e, state.e)) if since > 0.0 else _ZERO
    return e + e_dot


@compiled
def observe(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values of `SIGNALS`."""
    return (
        reference.mu,
        reference.alpha,
        reference.beta,
        *output.E,
        gains.k_up * output.eps,
        *state.x2_d,
        state.theta1,
        state.theta2,
        *output.d,
        *output.wanted,
    )


def check(gains: Gains, flight: Flight) -> list[Problem]:
    """Conditions on the gains, from the chapter or from the sampling of the law."""
    problems = bounds_errors(gains, flight, _STEEPEST, _LOST)
    if gains.neighbour_filter > 0.0 and gains.substeps % 2 == 1:
        problems.append(Problem(False, f"gain substeps = {gains.substeps:g}: odd numbers make the rudder chatter"))
    degree = max(len(flight.graph.senders(uav)) for uav in flight.graph.uavs)
    if gains.neighbour_filter > 0.0 and degree > MOST_NEIGHBOURS:
        problems.append(Problem(True, f"a UAV hears {degree} neighbours; at most {MOST_NEIGHBOURS} can be filtered"))
    return problems + _sampled_well(gains, flight.period)


def _sampled_well(gains: Gains, period: float) -> list[Problem]:
    """Limits on observer and filters from the control period (s).

    Measured at 200 Hz on the published faults (largest bank error from 3 s on, deg; mean change of the aileron's
    command per tick, deg):

        observer              1     10     20     40     80     90    160    400    1000   5000 rad/s
        observer * period  .005    .05     .1     .2     .4    .45     .8      2       5     25
        bank error         14.3    3.4    1.7    1.6    1.4    1.3    1.2    1.8    13.3   14.4
        aileron             .16    .07    .07    .07    .12    .61    1.6     30      36     37

    The low-pass flies up to 200 rad/s and ends in infinities at 300. Neighbours' errors, filtered: the aileron changes
    by .09 deg up to 20 rad/s, by 1.7 deg at 25, whatever the exchange rate.
    """
    problems = stable_in_steps({"observer": gains.observer}, period)
    fast = gains.observer * period
    if _FASTEST_OBSERVER < fast < 2.0:
        problems.append(
            Problem(
                False,
                f"gain observer = {gains.observer:g} rad/s: {fast:.2g} of the control rate, {1.0 / period:.0f} Hz; the "
                f"surfaces chatter beyond {_FASTEST_OBSERVER:g}, {_FASTEST_OBSERVER / period:.0f} rad/s",
            )
        )
    if 0.0 < gains.observer <= _SLOWEST_OBSERVER:
        problems.append(
            Problem(
                False,
                f"gain observer = {gains.observer:g} rad/s: slower than the faults; from {_SLOWEST_OBSERVER:g} rad/s "
                "down the bank error is twice as large and more",
            )
        )
    if gains.w_u * period >= _FASTEST_LOW_PASS:
        problems.append(
            Problem(
                True,
                f"gain w_u = {gains.w_u:g} rad/s: must be below {_FASTEST_LOW_PASS / period:.0f} rad/s, or its steps "
                f"of {period * 1e3:g} ms are unstable",
            )
        )
    if gains.neighbour_filter > _FASTEST_NEIGHBOURS:
        problems.append(
            Problem(
                False,
                f"gain neighbour_filter = {gains.neighbour_filter:g} rad/s: beyond {_FASTEST_NEIGHBOURS:g} rad/s the "
                "steps between the neighbours' records make the surfaces chatter",
            )
        )
    return problems
