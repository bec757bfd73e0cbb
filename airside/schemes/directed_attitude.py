"""Decentralized attitude control over a directed graph.

Source: Yu, Zhang, Jiang, Su: Fault-Tolerant Cooperative Control of Unmanned Aerial Vehicles, Springer 2024, chapter 8;
equation numbers are the monograph's. Each UAV regulates a weighted sum of its own attitude error and of its differences
to the errors of its in-neighbours, inside a shrinking bound. Each of the two loops has a radial-basis network and a
disturbance observer, which compensate unknown aerodynamics, loss of the surfaces' effectiveness and their bias. There
is no leader.

The chapter's table of parameters and the layout of its networks are lost; those here are chosen. `step` follows the
order of the chapter and is therefore long. Departures from the printed law:
- the auxiliary signal enters (8.26) as k5 mu1/eta, which the proof needs (8.46), instead of k5 mu1;
- floored denominators instead of the freeze and reset of the auxiliary systems (Remark 8.1);
- the error that the transform sees is limited to a share of the bound, the virtual rate command to `rate_limit`;
- one explicit Euler step per tick, but implicit ones for the auxiliary systems and the low-passed command, and an exact
  one for the first-order filter;
- a neighbour whose newest record is too old is left out of the error, of its gain and of the derivatives.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside import ranges
from ftcc.airside.attitude_model import (
    attitude_drift,
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
)
from ftcc.airside.conditions import bounds_errors, stable_in_steps
from ftcc.airside.elements.filters import implicit_butterworth_step
from ftcc.airside.elements.neighbours import error_sums
from ftcc.airside.elements.networks import adapt_neuron, network_inputs
from ftcc.airside.elements.nonlinear import clip
from ftcc.airside.elements.performance import bounded_transforms, performance_tube
from ftcc.airside.elements.saturation import vector_auxiliary_step
from ftcc.airside.elements.vectors import (
    added,
    applied,
    applied_transposed,
    dot,
    limited_to,
    nearest_turns,
    over,
    scaled,
    subtracted,
    times,
)
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.references.attitude import Reference
from ftcc.airside.scheme import Flight, Heard, Problem, Quantity
from ftcc.airside.vocabulary import ATTITUDE_TRACKING, angles, body_rates, surfaces
from ftcc.link.compiled import Room, Vector, compiled
from ftcc.link.graph import Assumption, GraphError

__all__ = ["Gains", "Output", "State", "check", "observe", "share", "start", "step"]

Q = Quantity


class Gains(NamedTuple):
    """Design parameters, all chosen but the bound, which is that of chapter 7; then switches (0 or 1) and guards."""

    lambda1: Annotated[float, Q("lambda_1", "-", "own attitude error", 0.4)]
    lambda2: Annotated[float, Q("lambda_2", "-", "differences to the neighbours' errors", 0.25)]
    k_up: Annotated[float, Q("k_up", "-", "upper bound", 1.1)]
    k_lo: Annotated[float, Q("k_lo", "-", "lower bound", 1.1)]
    eps0: Annotated[float, Q("eps_0", "rad", "bound at the start", 0.4)]
    eps_inf: Annotated[float, Q("eps_inf", "rad", "bound at the end", 0.15)]
    iota: Annotated[float, Q("iota", "1/s", "decay of the bound", 0.5)]
    k1: Annotated[float, Q("k1", "1/s", "predictor of the attitude", 20.0)]
    k2: Annotated[float, Q("k2", "1/s", "observer of the attitude's disturbance", 1.5)]
    k3: Annotated[float, Q("k3", "-", "prediction error of the attitude in the adaptation", 0.4)]
    k4_mu: Annotated[float, Q("K4", "1/s", "transformed error, bank", 6.0)]
    k4_alpha: Annotated[float, Q("K4", "1/s", "transformed error, alpha", 1.5)]
    k4_beta: Annotated[float, Q("K4", "1/s", "transformed error, sideslip", 1.5)]
    k5: Annotated[float, Q("k5", "1/s", "auxiliary system of the attitude", 2.0)]
    k6: Annotated[float, Q("k6", "-", "adaptation of the first network, 0: off", 0.1)]
    k7: Annotated[float, Q("k7", "-", "leak of the first network", 0.1)]
    r1: Annotated[float, Q("r1", "-", "scale of the first network", 1.0)]
    r2: Annotated[float, Q("r2", "-", "scale of the second network", 1.0)]
    k8: Annotated[float, Q("k8", "1/s", "predictor of the rates", 12.0)]
    k9: Annotated[float, Q("k9", "1/s", "observer of the rates' disturbance", 9.0)]
    k10: Annotated[float, Q("k10", "-", "prediction error of the rates in the adaptation", 0.4)]
    k11_p: Annotated[float, Q("K11", "1/s", "roll-rate error", 4.0)]
    k11_q: Annotated[float, Q("K11", "1/s", "pitch-rate error", 7.0)]
    k11_r: Annotated[float, Q("K11", "1/s", "yaw-rate error", 5.0)]
    k12: Annotated[float, Q("k12", "1/s", "auxiliary system of the rates", 2.0)]
    k13: Annotated[float, Q("k13", "-", "adaptation of the second network, 0: off", 0.5)]
    k14: Annotated[float, Q("k14", "-", "leak of the second network", 0.1)]
    mu1_floor: Annotated[float, Q("mu_1b", "rad^2/s^2", "floor of the first auxiliary system", 1e-4)]
    mu2_floor: Annotated[float, Q("mu_2b", "rad^2", "floor of the second auxiliary system", 1e-4)]
    tau: Annotated[float, Q("tau", "s", "first-order filter of the rate command", 0.04)]
    w_u: Annotated[float, Q("w_B", "rad/s", "low-pass of the command, input of the second network", 40.0)]
    observer1: Annotated[float, Q("observer_1", "-", "1: disturbance observer of the attitude", 1.0)]
    observer2: Annotated[float, Q("observer_2", "-", "1: disturbance observer of the rates", 1.0)]
    nominal: Annotated[float, Q("nominal", "-", "1: nominal model in the place of the networks", 0.0)]
    derivatives: Annotated[float, Q("derivatives", "-", "1: neighbours' error rates are used", 1.0)]
    oldest: Annotated[float, Q("oldest", "s", "age at which a neighbour is dropped, 0: held (not in paper)", 0.5)]
    edge: Annotated[float, Q("edge", "-", "share of the bound that the transform sees (not in paper)", 0.95)]
    rate_limit: Annotated[float, Q("rate_limit", "rad/s", "largest rate command (not in paper)", 10.0)]


RANGES = {
    ranges.WEIGHT: "lambda1",
    ranges.COUPLING: "lambda2 k3 k10",
    ranges.LAYER: "k_up k_lo eps0 eps_inf r1 r2 mu1_floor mu2_floor",
    ranges.FREQUENCY: "iota w_u",
    ranges.FEEDBACK: "k1 k2 k4_mu k4_alpha k4_beta k5 k8 k9 k11_p k11_q k11_r k12",
    ranges.ADAPTATION: "k6 k13",
    ranges.LEAK: "k7 k14",
    ranges.FILTER_TIME: "tau",
    ranges.SWITCH: "observer1 observer2 nominal derivatives",
    ranges.TIME: "oldest",
    ranges.INNER_SHARE: "edge",
    ranges.LIMIT: "rate_limit",
}


class State(NamedTuple):
    """Internal states of one UAV."""

    began: Annotated[float, Q("t_0", "s", "time of the first tick")]
    ticks: Annotated[float, Q("k", "-", "ticks done")]
    pi1: Annotated[Vector, Q("pi_1", "rad/s", "observer of the attitude's disturbance")]
    pi2: Annotated[Vector, Q("pi_2", "rad/s^2", "observer of the rates' disturbance")]
    x1_hat: Annotated[Vector, Q("X1_hat", "rad", "predicted attitude")]
    x2_hat: Annotated[Vector, Q("X2_hat", "rad/s", "predicted rates")]
    x2_d: Annotated[Vector, Q("X2_d", "rad/s", "filtered rate command")]
    mu1: Annotated[Vector, Q("mu_1", "rad/s", "auxiliary system of the attitude")]
    mu2: Annotated[Vector, Q("mu_2", "rad", "auxiliary system of the rates")]
    u_f: Annotated[Vector, Q("u_0f", "rad", "low-passed command")]
    u_f_dot: Annotated[Vector, Q("u_0f_dot", "rad/s", "its rate")]
    error_rate: Annotated[Vector, Q("x_tilde_dot", "rad/s", "estimated rate of the attitude error, for the neighbours")]
    W1: Annotated[NDArray[np.float64], Q("W1", "rad/s", "weights of the first network"), Room((27, 3))]
    W2: Annotated[NDArray[np.float64], Q("W2", "rad/s^2", "weights of the second network"), Room((17, 3))]


class Output(NamedTuple):
    """Commands first, then the other results of one evaluation of the law."""

    aileron: float
    elevator: float
    rudder: float
    e: Vector
    """Synchronization error, rad."""
    eps: float
    """Bound, rad."""
    D1: Vector
    D2: Vector
    W1: float
    """Frobenius norms of the weights."""
    W2: float
    wanted: Vector
    """Deflections before the limits, rad."""


SHARED = {
    "follower": (
        *angles("{}_error", "rad", "attitude error, {}"),
        *angles("{}_error_rate", "rad/s", "its estimated rate", rate_of="{}_error"),
    ),
    "leader": (),
}
CARRIES = False
SIGNALS = (
    *angles("{}_d", "rad", "reference, {}"),
    *angles("e_{}", "rad", "synchronization error, {}", bound="wall"),
    Q("wall", "rad", "upper bound"),
    *body_rates("{}_d", "rad/s", "filtered rate command, {}"),
    *angles("D1_{}", "rad/s", "estimated disturbance, {}"),
    *body_rates("D2_{}", "rad/s^2", "estimated disturbance, {} rate"),
    Q("W1", "rad/s", "norm of the first network's weights"),
    Q("W2", "rad/s^2", "norm of the second network's weights"),
    *surfaces("{}_wanted", "rad", "{} before its limits"),
)
TRACKING = ATTITUDE_TRACKING
GRAPH = Assumption.NONE
COMMANDS = ("aileron", "elevator", "rudder")
PLANT = "attitude"
FORMS: dict[str, dict[str, float]] = {"flight": {}, "monograph": {}}
SWITCHES = {
    "fault_tolerance": {"k6": 0.0, "k13": 0.0, "observer1": 0.0, "observer2": 0.0, "nominal": 1.0},
    "networks": {"k6": 0.0, "k13": 0.0},
    "observers": {"observer1": 0.0, "observer2": 0.0},
}

_LEAST_AIRSPEED = 8.0
"""Airspeed guard, m/s: the surfaces' effect is proportional to V^2."""
_LARGEST_SIDESLIP = math.radians(60.0)
"""Sideslip guard in the kinematics, rad."""
_STEEPEST, _LOST = 5.5, 6.8
"""Largest phi / (k eps_inf) flown with success behind surfaces of 20 rad/s, and the least that was lost, 1/rad."""
_FASTEST_OBSERVER = 0.3
"""Largest k9 times the control period, see `_sampled_well`."""
_ZERO = (0.0, 0.0, 0.0)

# The networks, all chosen: what counts as 0 and as 1 in an input, how far an input counts, and the neurons' width.
_DEGREES = math.radians(1.0)
_TRIM = 4.0 * _DEGREES
"""Angle of attack that counts as 0."""
_ANGLE_SCALE = (20.0 * _DEGREES, 4.0 * _DEGREES, 4.0 * _DEGREES)
_RATE_SCALE = (30.0 * _DEGREES, 20.0 * _DEGREES, 20.0 * _DEGREES)
"""Per second."""
_COMMAND_TRIM = -15.0 * _DEGREES
"""Elevator that counts as 0."""
_COMMAND_SCALE = (30.0 * _DEGREES, 30.0 * _DEGREES, 30.0 * _DEGREES)
_LARGEST_INPUT = 3.0
"""Of the second network."""
_SPREAD = 8.0 * 1.2 * 1.2
"""Of a neuron of the second network: its activation falls by 1/e at this squared distance."""


@compiled
def start(own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains) -> State:
    """State at the first tick: predictions as measured, estimated disturbances 0, networks empty."""
    x1, x2 = attitude_of(own), body_rates_of(own)
    return State(
        began=own.t, ticks=0.0,
        pi1=scaled(-gains.k2, x1), pi2=scaled(-gains.k9, x2), x1_hat=x1, x2_hat=x2,
        x2_d=_ZERO, mu1=_ZERO, mu2=_ZERO, u_f=_ZERO, u_f_dot=_ZERO, error_rate=_ZERO,
        W1=0.0, W2=0.0,  # type: ignore[arg-type]
    )  # fmt: skip


@compiled
def _adapt_first(W, own, error, gains, dt):
    """Output of the first network (before r1); its weights a tick later (8.27). 27 centres on the grid {-1, 0, 1}^3."""
    mu, alpha, beta = over((own.mu, own.alpha - _TRIM, own.beta), _ANGLE_SCALE)
    output = _ZERO
    n = 0
    for i in range(-1, 2):
        for j in range(-1, 2):
            for k in range(-1, 2):
                activation = math.exp(-((mu - i) * (mu - i)) - (alpha - j) * (alpha - j) - (beta - k) * (beta - k))
                output = added(output, adapt_neuron(W, n, activation, error, gains.k6, gains.k7, dt))
                n += 1
    return output


@compiled
def _adapt_second(W, own, u_f, error, gains, dt):
    """Output of the second network (before r2); its weights a tick later (8.39). 17 centres: 0 and +-1 on each axis."""
    aileron, elevator, rudder = u_f
    angles = (own.mu, own.alpha - _TRIM, own.beta)
    command = (aileron, elevator - _COMMAND_TRIM, rudder)
    _, alpha, beta = network_inputs(angles, _ANGLE_SCALE, _LARGEST_INPUT)
    rates = network_inputs(body_rates_of(own), _RATE_SCALE, _LARGEST_INPUT)
    inputs = (alpha, beta, *rates, *network_inputs(command, _COMMAND_SCALE, _LARGEST_INPUT))
    square = 0.0
    for z in inputs:
        square += z * z
    output = adapt_neuron(W, 0, math.exp(-square / _SPREAD), error, gains.k13, gains.k14, dt)
    n = 1
    for z in inputs:
        plus, minus = square - 2.0 * z + 1.0, square + 2.0 * z + 1.0
        output = added(output, adapt_neuron(W, n, math.exp(-plus / _SPREAD), error, gains.k13, gains.k14, dt))
        output = added(output, adapt_neuron(W, n + 1, math.exp(-minus / _SPREAD), error, gains.k13, gains.k14, dt))
        n += 2
    return output


@compiled
def _frobenius(W):
    total = 0.0
    for n in range(W.shape[0]):
        for axis in range(3):
            total += W[n, axis] * W[n, axis]
    return math.sqrt(total)


@compiled
def step(state: State, own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains, dt: float):
    """One tick: the state ``dt`` seconds later, and the output now. All rates are those at the start of the tick."""
    first = state.ticks == 0.0
    V = max(own.V, _LEAST_AIRSPEED)
    # The measured bank may jump by a turn; prediction and observer must not.
    x1, x2 = nearest_turns(attitude_of(own), state.x1_hat), body_rates_of(own)
    reference_rate = reference_rates_of(reference)
    W1_norm, W2_norm = _frobenius(state.W1), _frobenius(state.W2)

    # Synchronization error (8.10) in its bound (8.12).
    error = attitude_error(own, reference)
    weights, differences, rates_sum = error_sums(error, heard, gains.oldest)
    phi = gains.lambda1 + gains.lambda2 * weights
    e = added(scaled(gains.lambda1, error), scaled(gains.lambda2, differences))
    eps, eps_rate = performance_tube(own.t - state.began, gains.eps0, gains.eps_inf, gains.iota)
    E, eta = bounded_transforms(e, eps, gains.k_lo, gains.k_up, gains.edge, 0.0)
    steep = times(eta, E)

    # Outer loop (8.22)-(8.28).
    sideslip = clip(own.beta, -_LARGEST_SIDESLIP, _LARGEST_SIDESLIP)
    g1 = kinematics(own.alpha, sideslip)
    turning = applied(g1, x2)
    U1 = subtracted(x1, state.x1_hat)
    learned = added(steep, scaled(gains.k3, U1))
    f1 = scaled(1.0 / gains.r1, _adapt_first(state.W1, own, scaled(phi / gains.r1, learned), gains, dt))
    if gains.nominal > 0.0:
        f1 = attitude_drift(own.V, own.gamma, (own.mu, own.alpha, sideslip), own.thrust, V, model)
    D1 = scaled(gains.observer1, added(state.pi1, scaled(gains.k2, x1)))
    wanted_rate = subtracted(reference_rate, added(f1, D1))
    pull = subtracted(times((gains.k4_mu, gains.k4_alpha, gains.k4_beta), E), scaled(gains.k5, state.mu1))
    shared = scaled(gains.lambda2 * gains.derivatives, rates_sum)
    pushed = subtracted(added(scaled(eps_rate / eps, e), shared), over(pull, eta))
    limit = (gains.rate_limit, gains.rate_limit, gains.rate_limit)
    x2_bar = applied(kinematics_inverse(own.alpha, sideslip), added(wanted_rate, scaled(1.0 / phi, pushed)))
    x2_bar = limited_to(x2_bar, scaled(-1.0, limit), limit)
    x2_d = x2_bar if first else state.x2_d
    zeta1 = subtracted(x2_d, x2_bar)

    # Inner loop (8.34)-(8.41).
    f2_nominal, g2 = body_rate_model(V, own.alpha, own.beta, x2, V, model)
    e2, U2 = subtracted(x2, x2_d), subtracted(x2, state.x2_hat)
    learned = added(e2, scaled(gains.k10, U2))
    f2 = scaled(1.0 / gains.r2, _adapt_second(state.W2, own, state.u_f, scaled(1.0 / gains.r2, learned), gains, dt))
    if gains.nominal > 0.0:
        f2 = f2_nominal
    D2 = scaled(gains.observer2, added(state.pi2, scaled(gains.k9, x2)))
    acceleration = subtracted(scaled(-1.0 / gains.tau, zeta1), added(f2, D2))
    acceleration = subtracted(acceleration, times((gains.k11_p, gains.k11_q, gains.k11_r), e2))
    acceleration = added(acceleration, scaled(gains.k12, state.mu2))
    acceleration = subtracted(acceleration, scaled(phi, applied_transposed(g1, steep)))
    wanted = deflections_for(g2, acceleration)
    u0 = limited_to(wanted, least_deflections(model), largest_deflections(model))
    zeta2 = subtracted(u0, wanted)

    # One step of the internal states.
    effect = applied(g2, u0)
    x1_hat_rate = added(added(f1, turning), added(D1, scaled(gains.k1, U1)))
    x2_hat_rate = added(added(f2, effect), added(D2, scaled(gains.k8, U2)))
    explained = added(added(f1, turning), added(state.pi1, scaled(gains.k2, x1)))
    driven = added(scaled(phi, steep), added(scaled(gains.k3 * phi, U1), E))
    pi1_rate = subtracted(driven, scaled(gains.k2, explained))
    explained = added(added(f2, effect), added(state.pi2, scaled(gains.k9, x2)))
    pi2_rate = subtracted(added(scaled(gains.k10, U2), e2), scaled(gains.k9, explained))
    mu1 = vector_auxiliary_step(state.mu1, gains.k5, phi * dot(steep, applied(g1, zeta1)), zeta1, gains.mu1_floor, dt)
    mu2 = vector_auxiliary_step(state.mu2, gains.k12, dot(e2, applied(g2, zeta2)), zeta2, gains.mu2_floor, dt)
    u_f, u_f_dot = implicit_butterworth_step(u0 if first else state.u_f, state.u_f_dot, u0, gains.w_u, dt)
    after = State(
        began=state.began, ticks=state.ticks + 1.0,
        pi1=added(state.pi1, scaled(dt, pi1_rate)), pi2=added(state.pi2, scaled(dt, pi2_rate)),
        x1_hat=added(state.x1_hat, scaled(dt, x1_hat_rate)), x2_hat=added(state.x2_hat, scaled(dt, x2_hat_rate)),
        x2_d=added(x2_bar, scaled(math.exp(-dt / gains.tau), zeta1)),
        mu1=mu1, mu2=mu2, u_f=u_f, u_f_dot=u_f_dot,
        error_rate=subtracted(x1_hat_rate, reference_rate),
        W1=state.W1, W2=state.W2,
    )  # fmt: skip
    aileron, elevator, rudder = u0
    output = Output(
        aileron=aileron, elevator=elevator, rudder=rudder,
        e=e, eps=eps, D1=D1, D2=D2, W1=W1_norm, W2=W2_norm, wanted=wanted,
    )  # fmt: skip
    return after, output


@compiled
def share(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Own attitude error, and its rate from the predictor of the tick before."""
    return attitude_error(own, reference) + state.error_rate


@compiled
def observe(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values of `SIGNALS`."""
    return (
        reference.mu,
        reference.alpha,
        reference.beta,
        *output.e,
        gains.k_up * output.eps,
        *state.x2_d,
        *output.D1,
        *output.D2,
        output.W1,
        output.W2,
        *output.wanted,
    )


def check(gains: Gains, flight: Flight) -> list[Problem]:
    """Conditions on the gains, from the chapter or from the sampling of the law."""
    problems = bounds_errors(gains, flight, _STEEPEST, _LOST)
    try:
        flight.graph.require(Assumption.STRONGLY_CONNECTED)
    except GraphError as error:
        problems.append(
            Problem(False, f"graph.edges: {error}; sound all the same, as every UAV knows its own reference")
        )
    problems += stable_in_steps({name: getattr(gains, name) for name in ("k1", "k2", "k8", "k9")}, flight.period)
    return problems + _sampled_well(gains, flight.period)


def _sampled_well(gains: Gains, period: float) -> list[Problem]:
    """Limits on filter and observer from the control period (s).

    Measured at 100 Hz on the published faults (largest bank error from 3 s on, deg; mean change of the aileron's
    command per tick, deg):

        tau            .001   .002  .003  .005  .007   .01   .02   .04   .16    .2    .3    .6 s
        bank error     lost    189   3.6   3.6   3.8   4.1   4.5   4.9   6.0   6.3    16    29
        aileron          16     10   2.4   1.0   .23   .10   .07   .05   .08   .14   .24   .93

        k9                1      3     9    20    28    32    36    40    80 1/s (alpha error instead of bank)
        alpha error     3.7    1.5   .83   .61   .58   1.3   2.5   3.3   6.9
        aileron         .13    .06   .05   .04   .04   .13   .57   .76   3.4

    At 200 Hz k9 = 60 1/s flies as 20 does, at a tau of a period as at one of two. k1, k2, k8 and w_u change next to
    nothing below 2 / period.
    """
    problems = stable_in_steps({"tau": 1.0 / gains.tau}, period)
    if not problems and gains.tau < period:
        problems.append(
            Problem(
                False,
                f"gain tau = {gains.tau:g} s: shorter than the control period, {period:g} s; the rate command's "
                "derivative is overrated, and the surfaces chatter",
            )
        )
    slowest = 1.0 / max(gains.k4_mu, gains.k4_alpha, gains.k4_beta)
    if gains.tau > 1.2 * slowest:
        problems.append(
            Problem(
                False,
                f"gain tau = {gains.tau:g} s: slower than the loop that it filters for, 1 / k4 = {slowest:.3g} s; "
                "errors grow to several times their size",
            )
        )
    if gains.k9 * period > _FASTEST_OBSERVER:
        problems.append(
            Problem(
                False,
                f"gain k9 = {gains.k9:g} 1/s: the rates' observer makes the loop cycle beyond "
                f"{_FASTEST_OBSERVER / period:.0f} 1/s at a control rate of {1.0 / period:.0f} Hz",
            )
        )
    return problems
