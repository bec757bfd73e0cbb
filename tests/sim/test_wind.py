"""Moving air: the 1-cosine gust, Dryden turbulence, and aircraft in both."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ftcc.groundside.scenario.wind import low_altitude
from ftcc.link.compiled import compiled
from ftcc.link.rotation import body_attitude
from ftcc.sim.build import build_fleet
from ftcc.sim.disturbances import Disturbance
from ftcc.sim.fleet import Fleet
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import conditions_of, cycle_of, find
from ftcc.sim.plants.position import drag
from ftcc.sim.spec import VehicleSpec
from ftcc.sim.wind import AIR, DiscreteGust, Turbulence, against, blow, dryden, moving_air
from tests.sim.test_position import UAV, point
from tests.support.swarm import AIRFRAME, vehicle

SURFACES = ((-0.7, 0.7),) * 3 + ((0.0, 120.0),)


def aircraft(plant: str, **changes: Any) -> VehicleSpec:
    """Level flight north at 30 m/s and 100 m, in trim for still air."""
    module = find(plant)
    airframe = module.Parameters(**{name: getattr(AIRFRAME, name) for name in module.Parameters._fields})
    steady = module.level(airframe, 30.0)._asdict()
    start = {"V": 30.0, "z": 100.0}
    command = (
        (0.0, 1.0, 0.0, steady["thrust"]) if plant == "guided" else (0.0, steady["elevator"], 0.0, steady["thrust"])
    )
    standard = {
        "plant": plant,
        "airframe": airframe,
        "initial": tuple(module.initial(start, steady)),
        "command": command,
        "limits": ((-1.2, 1.2), (0.0, 3.0), (0.0, 0.0), (0.0, 120.0)) if plant == "guided" else SURFACES,
    }
    return vehicle(**standard | changes)


def truth(plant: str, fleet: Fleet, i: int = 0) -> dict[str, float]:
    out = np.zeros(len(TRUTH))
    cycle_of(plant).actuate(fleet, i, 0.0)
    cycle_of(plant).truth(fleet, i, 0.0, out)
    return dict(zip(TRUTH, out.tolist(), strict=True))


def flown(plant: str, seconds: float, **changes: Any) -> dict[str, float]:
    """The true states after ``seconds``."""
    fleet = build_fleet([aircraft(plant, **changes)])
    assert cycle_of(plant).advance(fleet, 0, 0, round(seconds * 1e6), 1000) == 0
    return truth(plant, fleet)


def steady(plant: str, **channels: float) -> tuple[Disturbance, ...]:
    names = [name for name, _ in find(plant).DISTURBANCES]
    return tuple(Disturbance(0.0, float(names.index(name)), value, 0.0) for name, value in channels.items())


# --- gusts -----------------------------------------------------------------------------------------------------------


def test_a_gust_is_half_a_cosine_and_holds() -> None:
    """MIL-F-8785C, 3.7.1.3: V_m (1 - cos(pi x/d_m))/2 up to d_m, V_m beyond; whole ones fall as they rise."""
    held, whole = DiscreteGust(1.0, 2.0, 0.0, -3.0, 4.0), DiscreteGust(1.0, 2.0, 0.0, -3.0, 4.0, until=3.0)
    fleet = build_fleet(
        [aircraft("longitudinal", discrete_gusts=(held,)), aircraft("longitudinal", discrete_gusts=(whole,))]
    )
    for time, share in ((0.99, 0.0), (1.5, 0.5 * (1.0 - math.sqrt(0.5))), (2.0, 0.5), (3.0, 1.0), (9.0, 1.0)):
        assert [moving_air(fleet, 0, n, time) for n in range(3)] == pytest.approx([0.0, -3.0 * share, 4.0 * share])
    for time, share in ((2.0, 0.5), (3.0, 1.0), (4.5, 0.5 * (1.0 - math.sqrt(0.5))), (5.0, 0.0), (9.0, 0.0)):
        assert moving_air(fleet, 1, 2, time) == pytest.approx(4.0 * share, abs=1e-12)


def test_gusts_add_up() -> None:
    rows = (DiscreteGust(0.0, 1.0, 2.0, 0.0, 0.0), DiscreteGust(5.0, 1.0, -2.0, 0.0, 0.0))
    fleet = build_fleet([aircraft("longitudinal", discrete_gusts=rows)])
    assert [moving_air(fleet, 0, 0, t) for t in (4.0, 5.5, 7.0)] == pytest.approx([2.0, 1.0, 0.0])


# --- turbulence ------------------------------------------------------------------------------------------------------


STATIONARY = np.array([[1.0, 0.5], [0.5, 0.5]])
ACROSS = np.array([math.sqrt(3.0), 1.0 - math.sqrt(3.0)]) / math.sqrt(2.0)


@pytest.mark.parametrize("turn", [1e-6, 1e-3, 0.3, 5.0])
def test_the_discrete_filter_is_exact(turn: float) -> None:
    """Stationary from step to step, and two steps are one of twice the length."""

    def system(step_us: int) -> tuple[np.ndarray, np.ndarray]:
        _, decay, feed, l11, l21, l22 = dryden(Turbulence((1.0,) * 3, (turn,) * 3, step_us))[2]
        root = np.array([[l11, 0.0], [l21, l22]])
        return np.array([[decay, 0.0], [feed, decay]]), root @ root.T

    phi, noise = system(1_000_000)
    twice, noises = system(2_000_000)
    assert phi @ STATIONARY @ phi.T + noise == pytest.approx(STATIONARY, rel=1e-12)
    assert phi @ phi == pytest.approx(twice, rel=1e-12)
    assert phi @ noise @ phi.T + noise == pytest.approx(noises, rel=1e-9)


def test_its_correlation_is_that_of_the_spectra() -> None:
    """R = exp(-tau V/L), across times 1 - tau V/(2 L): what the Dryden spectra transform to; R(0) = 1."""
    _, decay, feed, *_ = dryden(Turbulence((1.0,) * 3, (0.7,) * 3, 1_000_000))[1]
    phi, tau = np.array([[decay, 0.0], [feed, decay]]), 0.7
    for n in range(5):
        lagged = np.linalg.matrix_power(phi, n) @ STATIONARY
        assert lagged[0, 0] == pytest.approx(math.exp(-n * tau))
        assert ACROSS @ lagged @ ACROSS == pytest.approx(math.exp(-n * tau) * (1.0 - 0.5 * n * tau))


@compiled
def _blown(fleet, first, out):
    for n in range(out.shape[0]):
        for i in range(out.shape[1]):
            for component in range(3):
                out[n, i, component] = moving_air(fleet, i, component, 0.0)
            blow(fleet, i, first + n + 1)


SHAKEN = Turbulence((1.5, 0.8, 0.6), (0.5, 1.0, 2.0), 100_000, seed=7)


def blown(uavs: tuple[int, ...], steps: int, turbulence: Turbulence = SHAKEN) -> np.ndarray:
    """(steps, vehicles, 3) of the air's velocity."""
    fleet = build_fleet([aircraft("longitudinal", uav=uav, turbulence=turbulence) for uav in uavs])
    out = np.zeros((steps, len(uavs), 3))
    _blown(fleet, 0, out)
    return out


def test_statistics_of_what_blows() -> None:
    """10^5 steps of 0.1 s: deviations, correlations, and independence of components and vehicles."""
    series = blown((1, 2), 100_000)
    assert series.std(axis=0) == pytest.approx(np.array([SHAKEN.deviation] * 2), rel=0.05)
    for component, rate in enumerate(SHAKEN.bandwidth):
        x = series[:, 0, component] / SHAKEN.deviation[component]
        for lag in (5, 10, 20):
            tau = 0.1 * lag * rate
            exact = math.exp(-tau) * (1.0 if component == 0 else 1.0 - 0.5 * tau)
            assert np.mean(x[lag:] * x[:-lag]) == pytest.approx(exact, abs=0.06)
    apart = np.corrcoef(series.reshape(-1, 6).T) - np.eye(6)
    assert np.abs(apart).max() < 0.06


def test_it_starts_stationary() -> None:
    """Over 200 vehicles the first values scatter as all others do."""
    first = blown(tuple(range(1, 201)), 1)[0]
    assert first.std(axis=0) == pytest.approx(np.array(SHAKEN.deviation), rel=0.2)


def test_each_vehicle_has_its_own_whoever_else_flies() -> None:
    together, alone, other = blown((4, 9), 50), blown((9,), 50), blown((9,), 50, SHAKEN._replace(seed=8))
    assert np.array_equal(together[:, 1], alone[:, 0])
    assert np.abs(other - alone).max() > 0.5


def test_the_low_altitude_model_is_that_of_the_standard() -> None:
    """MIL-F-8785C: at 1000 ft all lengths are 1000 ft and all deviations 0.1 W20; at 100 ft L_u is 490 ft."""
    deviation, length = low_altitude(10.0, 304.8)
    assert deviation == pytest.approx((1.0, 1.0, 1.0))
    assert length == pytest.approx((304.8,) * 3)
    deviation, length = low_altitude(10.0, 30.48)
    assert deviation[0] / deviation[2] == pytest.approx((0.177 + 0.0823) ** -0.4)
    assert (length[0] / 0.3048, length[2] / 0.3048) == pytest.approx((100.0 / 0.2593**1.2, 100.0))


# --- aircraft in moving air ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", ["longitudinal", "attitude", "guided"])
def test_a_vertical_gust_lifts_and_turns_the_nose_into_the_wind(plant: str) -> None:
    """An updraft w adds w/V to the angle of attack: lift S q CLa w/V, and the nose drops, for Cma < 0."""
    module = find(plant)
    spec = aircraft(plant)
    names = [name for name, _ in module.DISTURBANCES]
    still = module.Disturbances(*(0.0,) * len(names))
    s, a = module.State(*spec.initial), module.Parameters(*spec.airframe)
    u = module.Inputs(*spec.command)
    before, after = (
        dict(zip(module.State._fields, module.rates(s, u, d, a), strict=True))
        for d in (still, still._replace(wind_up=1.0))
    )
    lift = 0.5 * a.rho * 900.0 * a.S * a.CLa / 30.0 / a.m
    rising = after["vz"] - before["vz"] if plant == "guided" else 30.0 * (after["gamma"] - before["gamma"])
    assert rising == pytest.approx(lift, rel=0.02), "m/s^2"
    pitching = 0.5 * a.rho * 900.0 * a.S * a.c * a.Cma / 30.0 / a.Iy
    assert after["q"] - before["q"] == pytest.approx(pitching, rel=0.02), "rad/s^2"


UPDRAFT = (DiscreteGust(0.0, 2.0, 0.0, 0.0, 2.0),)


@pytest.mark.parametrize(
    ("plant", "least", "most"), [("longitudinal", 4.0, 12.0), ("attitude", 4.0, 12.0), ("guided", 0.4, 1.6)]
)
def test_an_aircraft_rises_in_an_updraft(plant: str, least: float, most: float) -> None:
    """8 m of air pass upwards; an inner loop that holds the load factor lets it act for a moment only."""
    assert least < flown(plant, 5.0, discrete_gusts=UPDRAFT)["z"] - flown(plant, 5.0)["z"] < most


def test_an_updraft_tilts_the_lift_of_a_point_forward() -> None:
    """Its load factor is held, so it gains speed instead: by g w/V, less the drag that grows with it."""
    calm, lifted = (build_fleet([point(discrete_gusts=gusts)]) for gusts in ((), UPDRAFT))
    for fleet in (calm, lifted):
        assert cycle_of("position").advance(fleet, 0, 0, 5_000_000, 1000) == 0
    growth, final, h = 2.0 * drag(50.0, 1.0, UAV) / UAV.m / 50.0, 0.0, 0.001
    for n in range(5000):
        w = 2.0 if n >= 2000 else 1.0 - math.cos(math.pi * n / 2000.0)
        final += h * (UAV.g * w / 50.0 - growth * final)
    gained = np.hypot(*lifted.state[0, 3:5]) - np.hypot(*calm.state[0, 3:5])
    assert gained == pytest.approx(final, rel=0.05)


@pytest.mark.parametrize("plant", ["longitudinal", "attitude", "guided"])
def test_in_air_that_moves_as_a_whole_an_aircraft_flies_as_in_still_air(plant: str) -> None:
    """Northwards at 6 m/s: over the ground 6 m/s faster, the same in all else."""
    module = find(plant)
    spec = aircraft(plant)
    faster = module.State(*spec.initial)
    faster = faster._replace(vx=faster.vx + 6.0) if plant == "guided" else faster._replace(V=faster.V + 6.0)
    # Out of trim, so that something happens.
    command = (0.3, 1.1, 0.0, 40.0) if plant == "guided" else (0.02 * (plant == "attitude"), -0.18, 0.0, 30.0)
    fleet = build_fleet([spec, aircraft(plant, initial=tuple(faster), disturbances=steady(plant, gust=6.0))])
    for i in range(2):
        fleet.command[i] = command
        assert cycle_of(plant).advance(fleet, i, 0, 2_000_000, 1000) == 0
    still, moving = truth(plant, fleet, 0), truth(plant, fleet, 1)
    assert moving["x"] - still["x"] == pytest.approx(12.0, abs=1e-6)
    assert (moving["y"], moving["z"]) == pytest.approx((still["y"], still["z"]), abs=1e-6)
    assert [moving[n] for n in "pqr"] == pytest.approx([still[n] for n in "pqr"], abs=1e-6)
    if plant != "guided":
        assert moving["theta"] == pytest.approx(still["theta"], abs=1e-6)


def test_six_degrees_of_freedom_in_the_plane_of_symmetry_are_the_longitudinal_ones() -> None:
    gusts = (DiscreteGust(0.2, 1.0, 1.5, 0.0, 2.0), DiscreteGust(1.5, 0.5, -3.0, 0.0, 1.0))
    plane, six = (flown(plant, 4.0, discrete_gusts=gusts) for plant in ("longitudinal", "attitude"))
    for name in ("V", "x", "z", "gamma", "theta", "q", "alpha"):
        assert six[name] == pytest.approx(plane[name], rel=1e-9, abs=1e-9)


def test_a_gust_from_the_left_pushes_to_the_right_and_turns_the_nose_into_it() -> None:
    """Air that moves to the right comes from the left: CYb < 0 pushes right, Cnb > 0 turns left."""
    blown = flown("attitude", 0.3, discrete_gusts=(DiscreteGust(0.0, 0.05, 0.0, 3.0, 0.0),))
    assert blown["y"] > 0.001
    assert blown["r"] < -0.01
    assert blown["x"] == pytest.approx(9.0, abs=0.05)


def test_angles_against_a_velocity_are_those_that_made_the_attitude() -> None:
    chi, gamma, mu, alpha, beta = 0.8, 0.2, -0.5, 0.1, 0.05
    v = 30.0 * math.cos(gamma) * math.cos(chi), 30.0 * math.cos(gamma) * math.sin(chi), 30.0 * math.sin(gamma)
    found = against(*body_attitude(chi, gamma, mu, alpha, beta), *v)
    assert found == pytest.approx((30.0, gamma, chi, mu, alpha, beta))


def test_what_blows_is_recorded() -> None:
    fleet = build_fleet([aircraft("longitudinal", discrete_gusts=(DiscreteGust(0.0, 1.0, 0.5, 0.0, 2.0),))])
    out = np.zeros(len(conditions_of("longitudinal")))
    cycle_of("longitudinal").conditions(fleet, 0, 3.0, out)
    assert conditions_of("longitudinal")[-3:] == tuple((name, "m/s") for name in AIR)
    assert out[-3:].tolist() == [0.5, 0.0, 2.0]
