"""Turning air: p_g, q_g and r_g of MIL-F-8785C, their exact filters, and aircraft in them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from ftcc.groundside.scenario.loading import ScenarioError, load
from ftcc.groundside.scenario.mission import resolve
from ftcc.groundside.scenario.wind import turning_air
from ftcc.link.compiled import compiled
from ftcc.link.rotation import body_attitude
from ftcc.sim.build import build_fleet
from ftcc.sim.fleet import Fleet
from ftcc.sim.plants import conditions_of, cycle_of, find
from ftcc.sim.turning_air import NOT_TURNING, TurnFilter, about_body_axes, filters, rotation
from ftcc.sim.wind import Turbulence, blow, dryden
from tests.sim.test_wind import STATIONARY, aircraft
from tests.support.swarm import AIRFRAME

SIGMA, LENGTH, V, SPAN = (1.6, 1.5, 1.0), (140.0, 140.0, 50.0), 30.0, AIRFRAME.b
"""m/s, m, m/s, m."""
STILL_AHEAD = Turbulence(SIGMA, tuple(V / one for one in LENGTH), 1000, seed=3)
TURNING = STILL_AHEAD._replace(turning=turning_air(SIGMA[2], LENGTH[2], SPAN, V))
ACROSS = np.array([math.sqrt(3.0), 1.0 - math.sqrt(3.0)]) / math.sqrt(2.0)


def rows_of(turbulence: Turbulence) -> np.ndarray:
    """The filters of its rotation, a `TurnFilter` each."""
    return filters(turbulence.turning, turbulence.deviation, turbulence.bandwidth, turbulence.step_us)


def spectrum(component: int, W: float) -> float:
    """MIL-F-8785C, 3.7.5 and 3.7.1.2, one-sided over the spatial frequency (rad/m), as printed."""
    if component == 0:
        height = SIGMA[2] ** 2 / LENGTH[2] * 0.8 * (math.pi * LENGTH[2] / (4.0 * SPAN)) ** (1.0 / 3.0)
        return height / (1.0 + (4.0 * SPAN * W / math.pi) ** 2)
    gust, spans = ((2, 4.0), (1, 3.0))[component - 1]
    x = (LENGTH[gust] * W) ** 2
    across = SIGMA[gust] ** 2 * LENGTH[gust] / math.pi * (1.0 + 3.0 * x) / (1.0 + x) ** 2
    return W * W / (1.0 + (spans * SPAN * W / math.pi) ** 2) * across


def correlation(component: int, distance: float) -> float:
    """Of the rate at two points that are ``distance`` (m) apart along the track: the spectrum's cosine transform."""
    if distance == 0.0:
        return float(quad(lambda W: spectrum(component, W), 0.0, np.inf, limit=500)[0])
    return float(quad(lambda W: spectrum(component, W), 0.0, np.inf, weight="cos", wvar=distance, limlst=500)[0])


def system(component: int, step_us: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Transition and noise covariance of z, r and m over a step, and the row that gives the rate of them."""
    turbulence = TURNING._replace(step_us=step_us)
    own = TurnFilter(*rows_of(turbulence)[component])
    _, decay, feed, l11, l21, l22 = dryden(turbulence)[3 - component]
    phi = np.array([[decay, 0.0, 0.0], [feed, decay, 0.0], [own.z, own.r, own.decay]])
    root = np.array([[l11, 0.0, 0.0], [l21, l22, 0.0], [own.first, own.second, own.own]])
    return phi, root @ root.T, own.gain * np.array([*ACROSS, -1.0])


def stationary(phi: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """The covariance that such steps leave as it is."""
    return np.linalg.solve(np.eye(9) - np.kron(phi, phi), noise.ravel()).reshape(3, 3)


@pytest.mark.parametrize("component", [1, 2])
def test_sampled_rates_of_the_gusts_have_exactly_the_specifications_correlation(component: int) -> None:
    """At every lag, by the recursion's matrices, against the integral of the printed spectrum; no step is too long."""
    for step_us in (1000, 50_000, 400_000):
        phi, noise, row = system(component, step_us)
        covariance = stationary(phi, noise)
        assert covariance[:2, :2] == pytest.approx(STATIONARY, rel=1e-9)
        scale = correlation(component, 0.0)
        for steps in (0, 1, 3, 10):
            found = row @ np.linalg.matrix_power(phi, steps) @ covariance @ row
            assert found == pytest.approx(correlation(component, steps * step_us / 1e6 * V), abs=1e-5 * scale)


def test_rolling_gusts_have_exactly_the_specifications_correlation() -> None:
    for step_us in (1000, 400_000):
        own = TurnFilter(*rows_of(TURNING._replace(step_us=step_us))[0])
        assert own.decay**2 + own.own**2 == pytest.approx(1.0, rel=1e-12)
        for steps in (0, 1, 4):
            exact = correlation(0, steps * step_us / 1e6 * V)
            assert own.gain**2 * own.decay**steps == pytest.approx(exact, abs=1e-5 * own.gain**2)


def test_sizes_are_those_of_the_spectra() -> None:
    """The integral of the spectrum of p_g in closed form, and bandwidths by four and three spans."""
    found = turning_air(2.0, 100.0, 3.25, 25.0)
    assert found.deviation == pytest.approx(0.95426 * 2.0 / (100.0 * 3.25**2) ** (1.0 / 3.0), rel=1e-5)
    quarter = math.pi * 25.0 / 3.25
    assert found.bandwidth == pytest.approx((quarter / 4.0, quarter / 4.0, quarter / 3.0))


@pytest.mark.parametrize("component", [1, 2])
def test_two_steps_are_one_of_twice_the_length(component: int) -> None:
    """Also where the two bandwidths are equal, and in very short and very long steps."""
    for step_us in (1, 1000, 3_000_000):
        phi, noise, _ = system(component, step_us)
        twice, noises, _ = system(component, 2 * step_us)
        assert phi @ phi == pytest.approx(twice, rel=1e-10)
        assert phi @ noise @ phi.T + noise == pytest.approx(noises, rel=1e-9)
    same = TURNING._replace(turning=TURNING.turning._replace(bandwidth=TURNING.bandwidth[::-1]))
    near = TURNING._replace(
        turning=TURNING.turning._replace(bandwidth=tuple(1.000001 * b for b in same.bandwidth[::-1]))
    )
    assert rows_of(same)[component] == pytest.approx(rows_of(near)[component], rel=1e-5)


@compiled
def _turned(fleet, first, out):
    for n in range(out.shape[0]):
        for i in range(out.shape[1]):
            rotation(fleet, i, out[n, i])
            blow(fleet, i, first + n + 1)


def turned(uavs: tuple[int, ...], steps: int, turbulence: Turbulence) -> tuple[np.ndarray, Fleet]:
    """(steps, vehicles, 3) of p_g, q_g, r_g, and the fleet behind them."""
    fleet = build_fleet([aircraft("attitude", uav=uav, turbulence=turbulence) for uav in uavs])
    out = np.zeros((steps, len(uavs), 3))
    _turned(fleet, 0, out)
    return out, fleet


def deviations() -> np.ndarray:
    return np.sqrt([correlation(component, 0.0) for component in range(3)])


def test_what_turns_has_the_specifications_deviations_and_is_independent() -> None:
    series, _ = turned((1, 2), 20_000, TURNING._replace(step_us=100_000))
    assert series.std(axis=0) == pytest.approx(np.array([deviations()] * 2), rel=0.05)
    assert np.abs(np.corrcoef(series.reshape(-1, 6).T) - np.eye(6)).max() < 0.06
    half = series[5:, 0, 1] @ series[:-5, 0, 1] / len(series)
    assert half == pytest.approx(correlation(1, 15.0), abs=0.06 * deviations()[1] ** 2)


def test_it_starts_stationary() -> None:
    """Over 200 vehicles the first values scatter as all others do, and as those after a while of any step."""
    series, _ = turned(tuple(range(1, 201)), 4, TURNING._replace(step_us=50_000))
    for row in (series[0], series[3]):
        assert row.std(axis=0) == pytest.approx(deviations(), rel=0.2)


def test_air_that_rises_faster_ahead_turns_nose_up_and_air_that_goes_right_nose_right() -> None:
    fleet = build_fleet([aircraft("attitude", turbulence=TURNING)])
    fleet.turned[0] = 0.0
    fleet.turbulence[0] = [[0.0, 0.0], [0.1, 0.0], [1.0, 0.0]]
    out = np.zeros(3)
    rotation(fleet, 0, out)
    assert out[0] == 0.0
    assert (out[1:] > 0.0).all()


def test_gusts_are_the_same_whether_their_air_turns_or_not() -> None:
    turns, still = (turned((5,), 50, one)[1] for one in (TURNING, STILL_AHEAD))
    assert np.array_equal(turns.turbulence, still.turbulence)
    assert np.array_equal(still.turned, np.zeros((1, 3)))


@pytest.mark.parametrize("plant", ["longitudinal", "attitude", "guided"])
def test_without_rotation_a_flight_is_the_same_bit_for_bit(plant: str) -> None:
    """Of turning air of no size: the same equations, the same gusts; and nothing more is recorded."""
    flown = []
    for turbulence in (STILL_AHEAD, TURNING, TURNING):
        fleet = build_fleet([aircraft(plant, turbulence=turbulence)])
        if len(flown) == 1:
            fleet.turning[0, :, 0] = 0.0
        assert cycle_of(plant).advance(fleet, 0, 0, 300_000, 1000) == 0
        flown.append(fleet.state[0].copy())
    assert np.array_equal(flown[0], flown[1])
    assert np.abs(flown[2] - flown[0]).max() > 1e-4
    assert [name for name, _ in conditions_of(plant)][-3:] == ["wind_along", "wind_right", "wind_up"]


@pytest.mark.parametrize("plant", ["longitudinal", "attitude", "guided"])
def test_damping_follows_the_rates_against_the_air(plant: str) -> None:
    """An aircraft that turns with its air is not damped: what its own rate does is undone by the air's, exactly."""
    module = find(plant)
    spec = aircraft(plant)
    s, a, u = module.State(*spec.initial), module.Parameters(*spec.airframe), module.Inputs(*spec.command)
    wind = module.Disturbances(*(0.0,) * len(module.DISTURBANCES))._replace(wind_up=0.5)

    def accelerations(d: object, **rates: float) -> dict[str, float]:
        return dict(zip(module.State._fields, module.rates(s._replace(**rates), u, d, a), strict=True))

    base = accelerations(wind)
    q_damping = 0.25 * a.rho * V * a.S * a.c * a.c * a.Cmq / a.Iy
    assert accelerations(wind._replace(q_g=0.2))["q"] - base["q"] == pytest.approx(-0.2 * q_damping, rel=0.01)
    assert accelerations(wind._replace(q_g=0.2), q=0.2)["q"] == pytest.approx(base["q"], abs=1e-9)
    if plant != "longitudinal":
        rolling = accelerations(wind._replace(p_g=0.2))["p"] - base["p"]
        assert rolling == pytest.approx(-0.2 * 0.25 * a.rho * V * a.S * a.b * a.b * a.Clp / a.Ix, rel=0.05)
        yawing = accelerations(wind._replace(r_g=0.2))["r"] - base["r"]
        assert yawing == pytest.approx(-0.2 * 0.25 * a.rho * V * a.S * a.b * a.b * a.Cnr / a.Iz, rel=0.1), (
            "its axis is the vertical"
        )


def test_the_rotation_is_that_of_the_track_and_not_of_the_body() -> None:
    """Level, it is the body's; banked to the right, air that turns nose up yaws it left; on any course alike."""
    for chi in (0.0, 2.0):
        level = about_body_axes(*body_attitude(chi, 0.0, 0.0, 0.0, 0.0), math.cos(chi), math.sin(chi), 0.1, 0.2, 0.3)
        assert level == pytest.approx((0.1, 0.2, 0.3))
        knife = body_attitude(chi, 0.0, 0.5 * math.pi, 0.0, 0.0)
        assert about_body_axes(*knife, math.cos(chi), math.sin(chi), 0.1, 0.2, 0.3) == pytest.approx((0.1, 0.3, -0.2))


def test_an_aircraft_near_the_ground_rolls_several_times_as_much() -> None:
    """Root mean square of p with fixed controls over 8 s, with the same gusts."""
    found = []
    for turbulence in (STILL_AHEAD, TURNING):
        fleet = build_fleet([aircraft("attitude", turbulence=turbulence)])
        p = []
        for n in range(160):
            assert cycle_of("attitude").advance(fleet, 0, 50_000 * n, 50_000, 1000) == 0
            p.append(fleet.state[0, find("attitude").State._fields.index("p")])
        found.append(np.std(p))
    assert found[1] > 3.0 * found[0]


AIR = "turbulence={{wind_20ft=8.0, altitude=50.0, turning={}, uavs=[1]}}"


def test_a_scenario_turns_the_air_by_the_span_of_its_airframe() -> None:
    on, off = (resolve(load("containment", settings=[AIR.format(turning)])) for turning in ("true", "false"))
    vehicle = on.vehicles[0]
    assert vehicle.turbulence.turning == turning_air(0.8, 50.0, AIRFRAME.b, vehicle.turbulence.turning.airspeed)
    assert {one.turbulence.turning for one in (*on.vehicles[1:], *off.vehicles)} == {NOT_TURNING}


@pytest.mark.parametrize(
    ("scenario", "said"),
    [
        ("fire_monitoring", "turbulence.turning = true: plant position has no body rates; leave it out"),
        ("jsbsim_attitude", "turbulence.turning = true: plant jsbsim flies by JSBSim, which takes no rotation"),
    ],
)
def test_a_plant_whose_air_cannot_turn_refuses(scenario: str, said: str) -> None:
    if scenario.startswith("jsbsim"):
        pytest.importorskip("jsbsim")
    with pytest.raises(ScenarioError) as caught:
        resolve(load(scenario, settings=[AIR.format("true")]))
    assert said in str(caught.value)
