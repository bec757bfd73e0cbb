"""Decentralized fault-tolerant elliptical formation around a spreading fire, on position level.

Source: Yu, Zhang, Jiang, Su: Fault-Tolerant Cooperative Control of Unmanned Aerial Vehicles, Springer 2024, chapter 9.
Its sections 9.1-9.3, equations (9.1)-(9.31), are not available to us: the law is a reconstruction [R] from the scenario
(section 9.4), the sliding surface that its last proof names, and what its figures show. (R1)-(R7) number its parts. No
leader: each UAV knows the fire, hence its own post (`ftcc.airside.references.position`); neighbours share tracking
errors.

Each UAV brings a cooperative error e to a fractional-order sliding surface S = e' + D^-a f(e). It compensates the
disturbance that a reference system with a sliding-mode differentiator estimates: faults of thrust, load factor and
bank, wind, gusts and other forces.

Beyond the reconstruction of the printed law, each a gain:
- limits on the error that the surface sees and on the commanded acceleration (Esat, Amax): without them a start tens of
  metres away is lost;
- a low-pass behind the observer, and an observer that knows lag and delay of the commands (flight form): without a
  model of the lag the loop is lost;
- the neighbours' commanded accelerations (the proof's term) left out but in the monograph form: sampled, they make the
  loop cycle.

Fractional order has no measurable effect while the observer is on; without it the memory acts as integral action, and
the residual error is 2.6 to 2.9 times smaller. Cooperation makes the cooperative error somewhat smaller, but moves the
healthy aircraft; the errors of two aircraft do not come closer to each other.

The file is long because vectors are tuples: each of the three axes is named where it is put together.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from ftcc.airside import ranges
from ftcc.airside.conditions import stable_in_steps
from ftcc.airside.elements.actuators import modelled_stroke
from ftcc.airside.elements.filters import low_pass_step
from ftcc.airside.elements.fractional import (
    COLUMNS,
    fractional_integral,
    fractional_rate,
    number_of_poles,
    remember,
    set_poles,
)
from ftcc.airside.elements.nonlinear import clip, limited, rounded_power
from ftcc.airside.elements.observers import reference_system_step
from ftcc.airside.elements.vectors import added, scaled, subtracted
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.point_mass import acceleration, commands_for, velocity
from ftcc.airside.references.position import Fire, Reference
from ftcc.airside.scheme import Flight, Heard, Problem, Quantity
from ftcc.airside.vocabulary import space
from ftcc.link.compiled import Room, Vector, compiled
from ftcc.link.graph import Assumption

__all__ = ["Fire", "Gains", "Output", "State", "check", "observe", "share", "start", "step"]

Q = Quantity

MOST_POLES = 40
"""Room for the fractional operator's poles."""


class Gains(NamedTuple):
    """Design parameters (all ours: the monograph's are lost), then switches (0 or 1) and settings."""

    lam1: Annotated[float, Q("lambda_1", "-", "own error in the cooperative error", 1.0)]
    lam2: Annotated[float, Q("lambda_2", "-", "disagreement with neighbours in it; 0: no cooperation", 1.0)]
    a: Annotated[float, Q("a_1", "-", "fractional order, 0: integer order", 0.2)]
    kap1: Annotated[float, Q("kappa_1", "1/s", "surface, linear", 4.0)]
    kap2: Annotated[float, Q("kappa_2", "m^(1-r)/s", "surface, power", 1.0)]
    r: Annotated[float, Q("p_1/q_1", "-", "its exponent", 0.6)]
    eps: Annotated[float, Q("epsilon", "m", "half-width within which the power is linear", 0.05)]
    k1: Annotated[float, Q("k_1", "1/s", "approach to the surface, linear", 12.0)]
    k2: Annotated[float, Q("k_2", "m/s^2", "approach to the surface, switching", 0.3)]
    phi_s: Annotated[float, Q("phi_s", "m/s", "boundary layer of the switching", 0.1)]
    k_eta: Annotated[float, Q("K_eta", "1/s", "reference system of the observer", 5.0)]
    bound: Annotated[float, Q("L", "m/s^3", "differentiator of the observer", 200.0)]
    tau_d: Annotated[float, Q("tau_D", "s", "low-pass behind the observer, 0: off", 0.0)]
    p_min: Annotated[float, Q("p_min", "rad/s", "slowest pole of the fractional operator", 1e-3)]
    p_max: Annotated[float, Q("p_max", "rad/s", "its fastest pole", 1e3)]
    per_decade: Annotated[float, Q("npd", "-", "its poles per decade", 3.0)]
    e_sat: Annotated[float, Q("E_sat", "m", "limit on the error that the surface sees, 0: off", 2.0)]
    a_max: Annotated[float, Q("A_max", "m/s^2", "limit on the commanded error acceleration, 0: off", 30.0)]
    n_max: Annotated[float, Q("n_max", "-", "largest load factor", 3.0)]
    bank_max: Annotated[float, Q("mu_max", "rad", "largest bank", 1.2)]
    observer: Annotated[float, Q("observer", "-", "1: disturbance observer on", 1.0)]
    feed: Annotated[float, Q("A_j", "-", "1: neighbours' commanded accelerations taken in", 0.0)]
    held: Annotated[float, Q("held", "-", "1: commands act a sample late and are held; 0: at once", 0.0)]
    lag_thrust: Annotated[float, Q("tau_T", "s", "modelled lag of the thrust, 0: none", 0.0)]
    lag_load: Annotated[float, Q("tau_n", "s", "modelled lag of the load factor, 0: none", 0.0)]
    lag_bank: Annotated[float, Q("tau_mu", "s", "modelled lag of the bank, 0: none", 0.0)]
    silence: Annotated[float, Q("silence", "s", "a neighbour silent for longer is left out, 0: never", 0.0)]


RANGES = {
    ranges.WEIGHT: "lam1",
    ranges.COUPLING: "lam2 kap2 k2",
    ranges.ORDER: "a r",
    ranges.FEEDBACK: "kap1 k1 k_eta bound",
    ranges.LAYER: "eps phi_s",
    ranges.OPTIONAL_TIME: "tau_d lag_thrust lag_load lag_bank",
    ranges.FREQUENCY: "p_min p_max",
    ranges.POLES: "per_decade",
    ranges.LIMIT_OR_OFF: "e_sat a_max",
    ranges.LIMIT: "n_max",
    ranges.BANK: "bank_max",
    ranges.SWITCH: "observer feed held",
    ranges.TIME: "silence",
}


class State(NamedTuple):
    """Internal states of one UAV; vectors are north, east, up."""

    eta: Annotated[Vector, Q("eta", "m/s", "reference system of the observer")]
    gap: Annotated[Vector, Q("sigma", "m/s", "velocity not explained by it")]
    zeta0: Annotated[Vector, Q("zeta0", "m/s", "differentiator: value")]
    zeta1: Annotated[Vector, Q("zeta1", "m/s^2", "differentiator: derivative")]
    d_hat: Annotated[Vector, Q("Dhat", "m/s^2", "estimated lumped disturbance")]
    f: Annotated[Vector, Q("f", "m/s", "f(e) of the last tick")]
    a_own: Annotated[Vector, Q("A_i", "m/s^2", "commanded error acceleration of the last tick")]
    position: Annotated[Vector, Q("w_m", "N, -, rad", "modelled actuators: thrust, load factor, bank")]
    force: Annotated[Vector, Q("w", "N, -, rad", "command that the vehicle reported in force at the last tick")]
    path: Annotated[Vector, Q("V", "m/s, rad, rad", "speed, flight-path angle and course at the last tick")]
    begun: Annotated[float, Q("begun", "-", "1 after the first tick")]
    poles: Annotated[object, Room((1 + MOST_POLES, COLUMNS)), Q("z_k", "m", "memory of the fractional operator")]


class Output(NamedTuple):
    """Commands first, then the other results of one step."""

    thrust: float
    load_factor: float
    bank: float
    e: Vector
    S: Vector
    d_hat: Vector


_POSITION_ERROR = space("Pt_{}", "m", "position error, {}")
SHARED = {
    "follower": (
        *_POSITION_ERROR,
        *space("Vt_{}", "m/s", "its rate, {}", rate_of="Pt_{}"),
        *space("At_{}", "m/s^2", "commanded error acceleration, {}, for the monograph form", rate_of="Vt_{}"),
    )
}
CARRIES = False
_ERROR, _ERROR_RATE, _ERROR_ACCELERATION = 0, 3, 6
"""Columns of what is shared, each the first of three axes."""
SIGNALS = (
    Q("x_ref", "m", "reference, north"),
    Q("y_ref", "m", "reference, east"),
    Q("z_ref", "m", "reference, altitude"),
    *_POSITION_ERROR,
    *space("e_{}", "m", "cooperative error, {}"),
    *space("S_{}", "m/s", "sliding variable, {}"),
    *space("Dhat_{}", "m/s^2", "estimated lumped disturbance, {}"),
    Q("V_ref", "m/s", "speed of the reference"),
    Q("fire_north", "m", "centre of the formation, north"),
    Q("fire_east", "m", "centre of the formation, east"),
)
TRACKING = (
    Q("x - x_ref", "m", "off the reference, north", bound=5.0),
    Q("y - y_ref", "m", "off the reference, east", bound=5.0),
    Q("z - z_ref", "m", "off the reference, altitude", bound=2.0),
)
GRAPH = Assumption.CONNECTED_UNDIRECTED
COMMANDS = ("thrust", "load_factor", "bank")
PLANT = "position"
FORMS = {
    "monograph": {"feed": 1.0},
    "flight": {
        "kap1": 0.8,
        "kap2": 0.05,
        "eps": 0.2,
        "k1": 1.5,
        "k2": 0.1,
        "phi_s": 0.5,
        "bound": 50.0,
        "tau_d": 0.15,
        "p_max": 30.0,
        "per_decade": 2.0,
        "e_sat": 8.0,
        "a_max": 6.0,
        "held": 1.0,
        "lag_thrust": 0.05,
        "lag_load": 0.175,
        "lag_bank": 0.2,
    },
}
SWITCHES = {
    "fault_tolerance": {"observer": 0.0, "e_sat": 0.0, "a_max": 0.0},
    "fractional_order": {"a": 0.0},
    "cooperation": {"lam2": 0.0},
}


_ZERO = (0.0, 0.0, 0.0)


@compiled
def _commands(own):
    """Thrust (N), load factor and bank (rad) in force; the latter two come in the places of elevator and aileron."""
    return own.thrust, own.elevator, own.aileron


@compiled
def _path(own):
    """Speed (m/s), flight-path angle and course (rad)."""
    return own.V, own.gamma, own.chi


@compiled
def _errors(own, reference):
    """Position error (m) and velocity error (m/s) at the time of the measurement."""
    place, planned = (own.x, own.y, own.z), (reference.x, reference.y, reference.z)
    planned_velocity = (reference.x_dot, reference.y_dot, reference.z_dot)
    return subtracted(place, planned), subtracted(velocity(*_path(own)), planned_velocity)


@compiled
def start(own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains) -> State:
    """State at the first tick; the memory of the fractional operator begins empty."""
    force, path = _commands(own), _path(own)
    return State(
        eta=velocity(*path), gap=_ZERO, zeta0=_ZERO, zeta1=_ZERO, d_hat=_ZERO, f=_ZERO, a_own=_ZERO,
        position=force, force=force, path=path, begun=0.0,
        poles=0.0,
    )  # fmt: skip


@compiled
def _observed_axis(s, axis, velocity_now, explained, gains, h):
    """Observer (R7) of one axis: d_hat, eta, gap, zeta0, zeta1."""
    estimate, eta, gap, zeta0, zeta1 = reference_system_step(
        s.eta[axis],
        s.gap[axis],
        s.zeta0[axis],
        s.zeta1[axis],
        velocity_now[axis],
        explained[axis],
        gains.k_eta,
        gains.bound,
        h,
    )
    return low_pass_step(s.d_hat[axis], estimate, gains.tau_d, h), eta, gap, zeta0, zeta1


@compiled
def _observed(s, own, model, gains, h):
    """Lumped disturbance and modelled actuators after the last ``h`` seconds, over which the model's mean counts.

    Returns
    -------
    d_hat, eta, gap, zeta0, zeta1, position : Vector
        As in `State`.
    """
    thrust_in, load_in, bank_in = s.force if gains.held > 0.0 else _commands(own)
    thrust_was, load_was, bank_was = s.position
    thrust, thrust_after = modelled_stroke(thrust_was, thrust_in, gains.lag_thrust, h)
    load, load_after = modelled_stroke(load_was, load_in, gains.lag_load, h)
    bank, bank_after = modelled_stroke(bank_was, bank_in, gains.lag_bank, h)
    V_was, gamma_was, chi_was = s.path
    before = acceleration(V_was, gamma_was, chi_was, thrust, load, bank, model)
    now = acceleration(own.V, own.gamma, own.chi, thrust, load, bank, model)
    v = velocity(*_path(own))
    mean = scaled(0.5, added(before, now))
    d_x, eta_x, gap_x, zeta0_x, zeta1_x = _observed_axis(s, 0, v, mean, gains, h)
    d_y, eta_y, gap_y, zeta0_y, zeta1_y = _observed_axis(s, 1, v, mean, gains, h)
    d_z, eta_z, gap_z, zeta0_z, zeta1_z = _observed_axis(s, 2, v, mean, gains, h)
    return (
        (d_x, d_y, d_z),
        (eta_x, eta_y, eta_z),
        (gap_x, gap_y, gap_z),
        (zeta0_x, zeta0_y, zeta0_z),
        (zeta1_x, zeta1_y, zeta1_z),
        (thrust_after, load_after, bank_after),
    )


@compiled
def _in_use(heard, j, gains):
    """Whether neighbour ``j`` takes part: heard, and not silent for too long."""
    return heard.valid[j] > 0.0 and (gains.silence <= 0.0 or heard.age[j] <= gains.silence)


@compiled
def _cooperative(heard, column, own, gains):
    """Cooperative error (R1) of the value in ``column``, and the sum of the weights of those who are heard."""
    total = gains.lam1 * own
    degree = 0.0
    for j in range(heard.weight.shape[0]):
        if _in_use(heard, j, gains):
            weight = heard.weight[j] * heard.trust[j, column]
            total += gains.lam2 * weight * (own - heard.values[j, column])
            degree += weight
    return total, degree


@compiled
def _fed(heard, column, gains):
    """The neighbours' commanded accelerations (R5), for the monograph form."""
    total = 0.0
    for j in range(heard.weight.shape[0]):
        if _in_use(heard, j, gains):
            total += heard.weight[j] * heard.trust[j, column] * heard.values[j, column]
    return gains.feed * gains.lam2 * total


@compiled
def _axis(s, axis, heard, error, rate, gains):
    """Error, sliding variable and commanded error acceleration (R1)-(R5) of one axis; its memory moves on."""
    e, degree = _cooperative(heard, _ERROR + axis, error[axis], gains)
    e_rate, _ = _cooperative(heard, _ERROR_RATE + axis, rate[axis], gains)
    seen = limited(e, gains.e_sat)
    power, slope = rounded_power(seen, gains.r, gains.eps)
    f = gains.kap1 * seen + gains.kap2 * power
    f_rate = (gains.kap1 + gains.kap2 * slope) * e_rate if seen == e else 0.0
    if s.begun > 0.0:
        remember(s.poles, axis, f, s.f[axis])
    S = e_rate + fractional_integral(s.poles, axis, f)
    nu = -fractional_rate(s.poles, axis, f, f_rate) - gains.k1 * S - gains.k2 * clip(S / gains.phi_s, -1.0, 1.0)
    own_weight = gains.lam1 + gains.lam2 * degree
    return e, S, f, limited((nu + _fed(heard, _ERROR_ACCELERATION + axis, gains)) / own_weight, gains.a_max)


@compiled
def step(state: State, own: Own, heard: Heard, reference: Reference, model: Model, gains: Gains, dt: float):
    """One tick: the state ``dt`` seconds later, and the output now."""
    s = state
    set_poles(s.poles, gains.a, gains.p_min, gains.p_max, gains.per_decade, dt)
    error, rate = _errors(own, reference)
    d_hat, eta, gap, zeta0, zeta1, position = s.d_hat, s.eta, s.gap, s.zeta0, s.zeta1, s.position
    if s.begun > 0.0:
        d_hat, eta, gap, zeta0, zeta1, position = _observed(s, own, model, gains, dt)
    e_x, S_x, f_x, a_x = _axis(s, 0, heard, error, rate, gains)
    e_y, S_y, f_y, a_y = _axis(s, 1, heard, error, rate, gains)
    e_z, S_z, f_z, a_z = _axis(s, 2, heard, error, rate, gains)
    a_own = (a_x, a_y, a_z)
    planned = (reference.x_ddot, reference.y_ddot, reference.z_ddot)
    x, y, z = subtracted(added(planned, a_own), scaled(gains.observer, d_hat))
    thrust, load_factor, bank = commands_for(x, y, z, own.V, own.gamma, own.chi, gains.bank_max, gains.n_max, model)
    after = State(
        eta=eta, gap=gap, zeta0=zeta0, zeta1=zeta1, d_hat=d_hat, f=(f_x, f_y, f_z), a_own=a_own,
        position=position, force=_commands(own), path=_path(own), begun=1.0,
        poles=s.poles,
    )  # fmt: skip
    output = Output(
        thrust=thrust, load_factor=load_factor, bank=bank,
        e=(e_x, e_y, e_z), S=(S_x, S_y, S_z), d_hat=d_hat,
    )  # fmt: skip
    return after, output


@compiled
def share(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values sent to the neighbours: errors at the time of the measurement, the acceleration of the tick before."""
    error, rate = _errors(own, reference)
    return (*error, *rate, *state.a_own)


@compiled
def observe(state: State, own: Own, reference: Reference, output: Output, gains: Gains):
    """Values of `SIGNALS`, at the time of the measurement."""
    error, _ = _errors(own, reference)
    x, y, z = reference.x_dot, reference.y_dot, reference.z_dot
    return (
        reference.x,
        reference.y,
        reference.z,
        *error,
        *output.e,
        *output.S,
        *output.d_hat,
        math.sqrt(x * x + y * y + z * z),
        reference.north,
        reference.east,
    )


def command_limits(gains: Gains) -> dict[str, tuple[float, float]]:
    """Load factor and bank that the law commands at most."""
    return {"load_factor": (-gains.n_max, gains.n_max), "bank": (-gains.bank_max, gains.bank_max)}


def check(gains: Gains, flight: Flight) -> list[Problem]:
    """Conditions on the gains of the reconstruction."""
    problems = []
    if not gains.p_max > gains.p_min:
        problems.append(Problem(True, f"gain p_max = {gains.p_max:g} rad/s: must exceed p_min, {gains.p_min:g} rad/s"))
    if not problems and number_of_poles(gains.p_min, gains.p_max, gains.per_decade) > MOST_POLES:
        problems.append(
            Problem(
                True,
                f"gains p_min = {gains.p_min:g}, p_max = {gains.p_max:g} rad/s and per_decade = {gains.per_decade:g}: "
                f"more than {MOST_POLES} poles",
            )
        )
    if gains.feed > 0.0 and flight.period > 0.005 + 1e-9:
        problems.append(
            Problem(
                False,
                f"gain feed = {gains.feed:g}: neighbours' commanded accelerations make the loop cycle at a control "
                f"period of {flight.period * 1e3:g} ms; they belong to 1 kHz",
            )
        )
    # At 50 Hz 80 1/s flies as 5 does, 99 1/s cycles by millimetres, 120 1/s loses the aircraft.
    problems += stable_in_steps({"k_eta": gains.k_eta}, flight.period)
    return problems
