"""The aircraft in six degrees of freedom: equations of motion, integration, and where the model ends."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from ftcc.airside.flight_path import Own, decode_state
from ftcc.link.actuators import AILERON, ELEVATOR, RUDDER, THRUST
from ftcc.sim.actuation import Autothrottle
from ftcc.sim.airframe import attitude_rates, longitudinal_rates, scaled
from ftcc.sim.build import build_fleet
from ftcc.sim.faults import Fault
from ftcc.sim.plant import LOST, TRUTH, Guards
from ftcc.sim.plants import cycle_of
from ftcc.sim.plants.attitude import State, initial
from ftcc.sim.sensors import encode_state
from ftcc.sim.spec import VehicleSpec
from tests.support.swarm import AIRFRAME, TRIM, vehicle

advance, truth, actuate = (getattr(cycle_of("attitude"), name) for name in ("advance", "truth", "actuate"))

HIGHER = scaled(AIRFRAME, {"all": 1.2, "CLde": 1.0})
"""All aerodynamic coefficients but the elevator lift 20 % higher."""

ALPHA = 0.0321750
LEVEL = State(0.0, 0.0, 1000.0, 30.0, 0.0, 0.0, 0.0, ALPHA, 0.0, 0.0, 0.0, 0.0)


def aircraft(**changes) -> VehicleSpec:
    """An aircraft in six degrees of freedom, in level trim at 30 m/s."""
    travel = ((-0.8, 0.8), (-0.8, 0.8), (-0.8, 0.8), (0.0, 120.0))
    return vehicle(**{"plant": "attitude", "initial": LEVEL, "limits": travel} | changes)


def flown(fleet, seconds: float, step_us: int = 1000) -> int:
    for start in range(0, round(seconds * 1e6), 10_000):
        why = int(advance(fleet, 0, start, 10_000, step_us))
        if why:
            return why
    return 0


@pytest.mark.parametrize(
    ("airframe", "expected"),
    [
        (
            AIRFRAME,
            (
                0.6549638696946825, 0.0739793742375719, 0.0621940963450775, 0.10143679576649456, -0.15875294110930413,
                0.016144414280444996, -3.7597563156090517, -4.861469914280526, 0.6909018326925461,
            ),
        ),
        (
            HIGHER,
            (
                0.48844719518699126, 0.09053212392181161, 0.15467451763692697, 0.10342799020267741,
                -0.25271660550346287, 0.013973913332445, -4.51217628405436, -5.834579122561614, 0.8282482402934707,
            ),
        ),
    ],
    ids=["nominal", "20 % higher"],
)  # fmt: skip
def test_rates_at_the_check_point_of_the_reference_airframe(airframe, expected):
    """Rates of (V, chi, gamma, mu, alpha, beta, p, q, r) as computed by an independent implementation."""
    rates = attitude_rates(
        27.0, -0.05, 0.2, 0.06, 0.03, 0.1, -0.08, 0.05, 0.02, -0.15, -0.03, 25.0, 0.0, 0.0, 0.0, airframe
    )
    assert rates == pytest.approx(expected, rel=1e-9)


def drawn(random: np.random.Generator) -> tuple[State, np.ndarray]:
    """A state and deflections from the envelope."""
    low = [0, 0, 0, 15.0, -3.0, -0.8, -1.2, -0.2, -0.3, -1.5, -1.5, -1.5]
    high = [0, 0, 0, 45.0, 3.0, 0.8, 1.2, 0.3, 0.3, 1.5, 1.5, 1.5]
    return State(*random.uniform(low, high).tolist()), random.uniform([-0.5, -0.5, -0.5, 0.0], [0.5, 0.5, 0.5, 100.0])


def body_to_inertial(s: State) -> Rotation:
    """North-east-down from forward-right-down."""
    path = Rotation.from_euler("ZYX", [s.chi, s.gamma, s.mu])
    return path * Rotation.from_euler("ZY", [-s.beta, s.alpha])


def test_rates_are_those_of_newton_and_euler():
    """Force and moment vectors, an inertia tensor and a rotation matrix, in place of (2.2)-(2.5)."""
    a = AIRFRAME
    tensor = np.array([[a.Ix, 0.0, -a.Ixz], [0.0, a.Iy, 0.0], [-a.Ixz, 0.0, a.Iz]])
    random = np.random.default_rng(3)
    for _ in range(200):
        s, u = drawn(random)
        aileron, elevator, rudder, thrust = u.tolist()
        rates = attitude_rates(
            s.V, s.gamma, s.mu, s.alpha, s.beta, s.p, s.q, s.r, aileron, elevator, rudder, thrust, 0.0, 0.0, 0.0, a
        )
        V_dot, chi_dot, gamma_dot, mu_dot, alpha_dot, beta_dot, *turning = rates
        pressure = 0.5 * a.rho * s.V**2 * a.S
        wind = Rotation.from_euler("ZYX", [s.chi, s.gamma, s.mu])
        lift = pressure * (a.CL0 + a.CLa * s.alpha + a.CLde * elevator)
        drag = pressure * (a.CD0 + a.CDa * s.alpha + a.CDa2 * s.alpha**2)
        force = wind.apply([-drag, pressure * a.CYb * s.beta, -lift]) + body_to_inertial(s).apply([thrust, 0.0, 0.0])
        acceleration = force / a.m + np.array([0.0, 0.0, a.g])
        along = wind.apply([1.0, 0.0, 0.0])
        across = np.array([-math.sin(s.chi), math.cos(s.chi), 0.0])
        assert V_dot == pytest.approx(acceleration @ along, abs=1e-10)
        assert chi_dot == pytest.approx(acceleration @ across / (s.V * math.cos(s.gamma)), abs=1e-10)
        assert gamma_dot == pytest.approx(-acceleration @ np.cross(along, across) / s.V, abs=1e-10)

        rate = np.array([s.p, s.q, s.r])
        p, q, r = rate * [a.b, a.c, a.b] / (2.0 * s.V)
        moment = pressure * np.array(
            [
                a.b * (a.Clb * s.beta + a.Clda * aileron + a.Cldr * rudder + a.Clp * p + a.Clr * r),
                a.c * (a.Cm0 + a.Cma * s.alpha + a.Cmde * elevator + a.Cmq * q),
                a.b * (a.Cnb * s.beta + a.Cnda * aileron + a.Cndr * rudder + a.Cnp * p + a.Cnr * r),
            ]
        )
        exact = np.linalg.solve(tensor, moment - np.cross(rate, tensor @ rate))
        assert turning == pytest.approx(exact, abs=1e-9)

        # The attitude that the angles' rates make is the one that the body rates make.
        h = 1e-6
        names = ("chi", "gamma", "mu", "alpha", "beta")
        slopes = (chi_dot, gamma_dot, mu_dot, alpha_dot, beta_dot)
        later, earlier = (
            body_to_inertial(s._replace(**{n: getattr(s, n) + sign * h * slope for n, slope in zip(names, slopes)}))
            for sign in (1.0, -1.0)
        )
        assert (earlier.inv() * later).as_rotvec() / (2.0 * h) == pytest.approx(rate, abs=1e-7)


def test_in_the_plane_of_symmetry_it_is_the_longitudinal_model():
    """One aircraft, one set of coefficients; the disturbances of the longitudinal chapters included."""
    random = np.random.default_rng(4)
    for _ in range(200):
        V, gamma, alpha, q, elevator, thrust, d1, d2, d3 = random.uniform(
            [12.0, -1.2, -0.3, -1.5, -0.7, 0.0, -0.3, -0.3, -0.3], [50.0, 1.2, 0.3, 1.5, 0.7, 120.0, 0.3, 0.3, 0.3]
        ).tolist()
        plane = longitudinal_rates(V, gamma, gamma + alpha, q, thrust, elevator, d1, d2, d3, AIRFRAME)
        V_dot, chi_dot, gamma_dot, mu_dot, alpha_dot, beta_dot, p_dot, q_dot, r_dot = attitude_rates(
            V, gamma, 0.0, alpha, 0.0, 0.0, q, 0.0, 0.0, elevator, 0.0, thrust, d1, d2, d3, AIRFRAME
        )
        assert (V_dot, gamma_dot, gamma_dot + alpha_dot, q_dot) == pytest.approx(
            (plane[0], plane[3], plane[4], plane[5]), abs=1e-11
        )
        assert (chi_dot, mu_dot, beta_dot, p_dot, r_dot) == (0.0,) * 5


def test_a_longitudinal_flight_is_the_same_on_both_models():
    """Ten seconds with lag, an elevator fault and a thrust step."""
    events = {"lag": (20.0,) * 4, "faults": (Fault(4.0, ELEVATOR, 0.8, 0.02, 0.0, 0.0),)}
    six = build_fleet([aircraft(**events)])
    travel = ((0.0, 0.0), (-0.8, 0.8), (0.0, 0.0), (0.0, 120.0))
    two = build_fleet([vehicle(initial=(30.0, 0.0, 1000.0, 0.0, ALPHA, 0.0), limits=travel, **events)])
    for fleet in (six, two):
        fleet.command[0] = (0.0, -0.19, 0.0, 25.0)
    longitudinal = cycle_of("longitudinal")
    for start in range(0, 10_000_000, 10_000):
        assert advance(six, 0, start, 10_000, 1000) == 0
        assert longitudinal.advance(two, 0, start, 10_000, 1000) == 0
    out, expected = np.zeros(len(TRUTH)), np.zeros(len(TRUTH))
    truth(six, 0, 10.0, out)
    longitudinal.truth(two, 0, 10.0, expected)
    assert out == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_two_seconds_agree_with_an_adaptive_integrator():
    """All surfaces deflected, from a sideslipping, banked start."""
    start = State(0.0, 5.0, 1000.0, 28.0, 0.3, 0.05, 0.2, 0.06, 0.05, 0.1, -0.05, 0.02)
    command = (0.03, -0.22, -0.04, 40.0)
    fleet = build_fleet([aircraft(initial=start)])
    fleet.command[0] = command
    assert flown(fleet, 2.0) == 0
    plain = getattr(attitude_rates, "py_func", attitude_rates)

    def rates(_: float, y: np.ndarray) -> list[float]:
        s = State(*y.tolist())
        ground = s.V * math.cos(s.gamma)
        motion = plain(s.V, s.gamma, s.mu, s.alpha, s.beta, s.p, s.q, s.r, *command, 0.0, 0.0, 0.0, AIRFRAME)
        return [ground * math.cos(s.chi), ground * math.sin(s.chi), s.V * math.sin(s.gamma), *motion]

    exact = solve_ivp(rates, (0.0, 2.0), list(start), method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    assert fleet.state[0] == pytest.approx(exact, rel=1e-8, abs=1e-8)


def test_a_flight_comes_back_from_its_messages():
    """Truth, encoded and decoded as an autopilot does, along a manoeuvre with everything in motion."""
    fleet = build_fleet([aircraft(initial=LEVEL._replace(beta=0.1, mu=0.3))])
    fleet.command[0] = (-0.1, -0.21, 0.05, 40.0)
    true, message, own = np.zeros(len(TRUTH)), np.zeros(13), np.zeros(len(Own._fields))
    for k in range(300):
        truth(fleet, 0, 0.01 * k, true)
        encode_state(true, message)
        decode_state(message, 0.01 * k, np.zeros(4), own)
        seen = Own(*own.tolist())
        for name, value in zip(TRUTH, true.tolist(), strict=True):
            assert getattr(seen, name) == pytest.approx(value, abs=4e-7 * max(1.0, abs(value))), (name, k)
        assert advance(fleet, 0, 10_000 * k, 10_000, 1000) == 0
    assert abs(fleet.state[0, State._fields.index("mu")]) > 1.0, "a manoeuvre"


def test_course_and_bank_are_told_within_half_a_turn():
    fleet = build_fleet([aircraft(initial=LEVEL._replace(chi=3.5, mu=-7.0))])
    out = np.zeros(len(TRUTH))
    truth(fleet, 0, 0.0, out)
    assert out[TRUTH.index("chi")] == pytest.approx(3.5 - 2.0 * math.pi)
    assert out[TRUTH.index("mu")] == pytest.approx(2.0 * math.pi - 7.0)


@pytest.mark.parametrize(
    ("deflected", "rate", "sign"),
    [(AILERON, "p", -1), (ELEVATOR, "q", -1), (RUDDER, "r", -1), (THRUST, "V", 1)],
)
def test_a_positive_deflection_turns_about_its_own_axis_negatively(deflected, rate, sign):
    fleet = build_fleet([aircraft()])
    fleet.command[0, deflected] += 0.05
    assert flown(fleet, 0.05) == 0
    change = fleet.state[0] - np.array(LEVEL)
    assert change[State._fields.index(rate)] * sign > 1e-6


def test_every_actuator_has_lag_limit_and_faults_of_its_own():
    lag = (20.0, 10.0, 5.0, 2.0)
    faults = tuple(Fault(0.0, n, 0.5, 0.01 * (n + 1), 0.0, 0.0) for n in range(4))
    fleet = build_fleet([aircraft(lag=lag, faults=faults)])
    command = np.array([0.05, -0.25, -0.05, 30.0])
    fleet.command[0] = command
    assert flown(fleet, 0.1) == 0
    actuate(fleet, 0, 0.1)
    position = command + (np.array(TRIM) - command) * np.exp(-np.array(lag) * 0.1)
    assert fleet.position[0] == pytest.approx(position, rel=1e-12)
    assert fleet.acting[0] == pytest.approx(0.5 * position + [0.01, 0.02, 0.03, 0.04], rel=1e-12)


@pytest.mark.parametrize("lag", [0.0, 20.0, 200.0])
def test_a_rate_limit_bounds_the_motion_exactly(lag):
    """At the limit until lag (command - position) falls below it, then exponentially."""
    target = 0.5
    fleet = build_fleet([aircraft(lag=(lag, 0.0, 0.0, 0.0), rate=(1.0, math.inf, math.inf, math.inf))])
    fleet.command[0, AILERON] = target
    near = 1.0 / lag if lag else 0.0
    for k in range(70):
        advance(fleet, 0, 10_000 * k, 10_000, 1000)
        t = 0.01 * (k + 1)
        after = t - (target - near)
        exact = t if after < 0.0 else target - near * math.exp(-lag * after)
        assert fleet.position[0, AILERON] == pytest.approx(exact, abs=1e-12), k


def test_the_autothrottle_holds_the_airspeed_instead_of_the_commanded_thrust():
    """thrust + gain (airspeed - V), within limits; elevator and thrust are those of the trim table."""
    fleet = build_fleet([aircraft(lag=(0.0, 0.0, 0.0, 20.0), autothrottle=Autothrottle(10.0, 25.0, 18.904))])
    fleet.command[0] = (0.0, -0.303011, 0.0, 111.0)
    actuate(fleet, 0, 0.0)
    assert fleet.acting[0, THRUST] == TRIM[THRUST], "of which the lag knows nothing yet"
    assert flown(fleet, 0.5) == 0
    assert fleet.position[0, THRUST] < 1e-2, "18.9 + 10 (25 - 30) lies below the lower limit"
    assert flown(fleet, 60.0) == 0
    assert fleet.state[0, State._fields.index("V")] == pytest.approx(25.0, abs=1e-3)
    assert fleet.position[0, THRUST] == pytest.approx(18.904, abs=0.01)


# Where the model ends.


@pytest.mark.parametrize(
    ("changes", "command", "reason"),
    [
        ({"gamma": 1.2}, (0.0, -0.2, 0.0, 0.0), "airspeed outside the model's valid range"),
        ({"gamma": 1.4, "q": 0.6}, (0.0, -0.5, 0.0, 120.0), "flight-path angle outside the model's valid range"),
        ({"alpha": 1.2, "q": 30.0}, TRIM, "angle of attack outside the model's valid range"),
        ({"beta": 1.0, "r": -30.0}, TRIM, "sideslip outside the model's valid range"),
        ({"p": math.nan}, TRIM, "state is not a number"),
        ({"V": 1e200}, TRIM, "state is not a number"),
    ],
    ids=["stall", "climb", "tumble", "spin", "nan", "overflow"],
)
def test_an_aircraft_that_leaves_its_model_is_lost_with_the_reason(changes, command, reason):
    fleet = build_fleet([aircraft(initial=LEVEL._replace(**changes), guards=Guards(10.0, 1.5, 1.5, 1.4))])
    fleet.command[0] = command
    assert LOST[flown(fleet, 20.0)] == reason


def test_whatever_is_commanded_an_aircraft_that_is_not_lost_has_a_finite_state():
    random = np.random.default_rng(5)
    ends = set()
    for _ in range(40):
        start, _ = drawn(random)
        fleet = build_fleet([aircraft(initial=start, lag=(20.0,) * 4, rate=(4.0, 4.0, 4.0, math.inf))])
        for k in range(600):
            if k % 20 == 0:
                fleet.command[0] = random.uniform(-1e3, 1e3, 4)
            why = int(advance(fleet, 0, k * 10_000, 10_000, 1000))
            if why:
                break
            assert np.isfinite(fleet.state).all()
        ends.add(LOST[why])
    assert len(ends) > 1, "aircraft were meant to be lost in more than one way"


def test_a_start_says_its_attitude_by_pitch_or_by_angle_of_attack():
    steady = {"alpha": 0.03}
    assert initial({"V": 30.0, "z": 1000.0}, steady).alpha == 0.03
    assert initial({"V": 30.0, "z": 1000.0, "gamma": 0.1, "theta": 0.15}, steady).alpha == pytest.approx(0.05)
    for also in ({"mu": 0.5}, {"beta": 0.2}, {"mu": -0.4, "beta": 0.1, "gamma": 0.2}):
        banked = initial({"V": 30.0, "z": 1000.0, "theta": 0.1} | also, steady)
        out = np.zeros(len(TRUTH))
        truth(build_fleet([aircraft(initial=banked)]), 0, 0.0, out)
        assert out[TRUTH.index("theta")] == pytest.approx(0.1, abs=1e-12)
        assert abs(banked.alpha) < 0.3
    with pytest.raises(ValueError, match="both given"):
        initial({"V": 30.0, "z": 1000.0, "theta": 0.1, "alpha": 0.03}, steady)
    with pytest.raises(ValueError, match=r"no angle of attack gives that pitch in a bank of 1.2"):
        initial({"V": 30.0, "z": 1000.0, "theta": 0.5, "mu": 1.2}, steady)


def test_factors_of_coefficients_by_name():
    assert HIGHER.CLa == 1.2 * AIRFRAME.CLa
    assert HIGHER.CLde == AIRFRAME.CLde
    assert HIGHER.m == AIRFRAME.m
    assert scaled(AIRFRAME, {"Clp": 0.5})._replace(Clp=AIRFRAME.Clp) == AIRFRAME
    with pytest.raises(ValueError, match="Ix: no aerodynamic coefficient; there are CD0, "):
        scaled(AIRFRAME, {"Ix": 2.0})
