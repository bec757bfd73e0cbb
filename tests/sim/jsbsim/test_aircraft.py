"""Aircraft of JSBSim on the bench and in flight, held against JSBSim's own trim, and against what they must not do."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import psutil
import pytest

pytest.importorskip("jsbsim", reason="JSBSim is not installed")

from ftcc.link.rotation import body_attitude
from ftcc.sim.jsbsim import aircraft as loading
from ftcc.sim.jsbsim.aircraft import Aircraft, JsbsimError, load, parts_of
from ftcc.sim.jsbsim.bench import Bench, Commands, Pose, prepare, set_commands
from ftcc.sim.jsbsim.controls import Controls, controls_of
from ftcc.sim.jsbsim.flight import Driven, FlownAircraft, Modelled, ModelState
from ftcc.sim.jsbsim.linear import linear_modes
from ftcc.sim.jsbsim.steady import Steady, steady_flight
from ftcc.sim.trim import TrimError

TRAINER = Aircraft("c172p")
V, ALTITUDE = 50.0, 1000.0
HOME = (47.4, 8.5, 400.0)


@pytest.fixture(scope="module")
def controls() -> Controls:
    return controls_of(TRAINER, V, ALTITUDE)


@pytest.fixture(scope="module")
def steady(controls: Controls) -> Steady:
    return steady_flight(TRAINER, controls, V, ALTITUDE)


def modelled(controls: Controls, steady: Steady, chi: float = 0.0) -> tuple[Modelled, np.ndarray, np.ndarray]:
    """The trainer in level flight on a course, its state, and what drives it."""
    model = Modelled(FlownAircraft(TRAINER, controls, HOME, ALTITUDE, 5000, 1), 1)
    pose = body_attitude(chi, 0.0, steady.mu, steady.alpha, 0.0)
    velocity = (V * math.cos(chi), V * math.sin(chi), 0.0)
    state = np.array([120.0, -80.0, ALTITUDE - HOME[2], *velocity, *pose, 0.0, 0.0, 0.0])
    driven = np.array([steady.aileron, steady.elevator, steady.rudder, steady.thrust, 0.0, 0.0, 0.0])
    model.begin(state, driven)
    return model, state, driven


def test_steady_flight_is_where_jsbsims_own_trim_is(controls: Controls, steady: Steady) -> None:
    """Its trim holds wings level where ours holds no sideslip: the propeller's share is small."""
    model = load(TRAINER)
    prepare(model, TRAINER)
    model["ic/h-sl-ft"], model["ic/vt-fps"], model["ic/gamma-deg"] = ALTITUDE / 0.3048, V / 0.3048, 0.0
    set_commands(model, Commands(throttle=0.6))
    model.run_ic()
    model.get_propulsion().init_running(-1)
    model.do_trim(1)
    assert math.degrees(model["aero/alpha-rad"]) == pytest.approx(math.degrees(steady.alpha), abs=0.02)
    assert model["fcs/throttle-cmd-norm"] == pytest.approx(controls.thrust.command(steady.thrust), abs=0.005)
    assert math.degrees(model["fcs/elevator-pos-rad"]) == pytest.approx(math.degrees(steady.elevator), abs=0.05)


def test_a_steady_aircraft_stays_as_it_is(controls: Controls, steady: Steady) -> None:
    model, state, driven = modelled(controls, steady, chi=0.7)
    begin = state.copy()
    for _ in range(2000):
        model.step(driven, state)
    flown = state[:2] - begin[:2]
    assert np.hypot(*flown) == pytest.approx(10.0 * V, rel=2e-3)
    assert math.atan2(flown[1], flown[0]) == pytest.approx(0.7, abs=0.01)
    assert abs(state[2] - begin[2]) < 1.0
    assert np.abs(state[3:] - begin[3:]).max() < 0.5


def test_it_starts_in_the_state_that_it_is_given(controls: Controls, steady: Steady) -> None:
    pose = body_attitude(-2.0, 0.05, 0.3, 0.04, 0.02)
    given = np.array([1500.0, -800.0, 900.0, -20.0, -44.0, 3.0, *pose, 0.1, -0.05, 0.02])
    state = given.copy()
    Modelled(FlownAircraft(TRAINER, controls, HOME, ALTITUDE, 5000, 1), 1).begin(state, np.zeros(7))
    turned = state[6:10] * np.sign(state[6] * given[6])
    assert state[:6] == pytest.approx(given[:6], abs=1e-5)
    assert turned == pytest.approx(given[6:10], abs=1e-9)
    assert state[10:] == pytest.approx(given[10:], abs=1e-6)


def test_a_positive_deflection_turns_negatively(controls: Controls, steady: Steady) -> None:
    for place, rate in ((Driven._fields.index(name), ModelState._fields.index(axis)) for name, axis in
                        (("aileron", "p"), ("elevator", "q"), ("rudder", "r"))):  # fmt: skip
        model, state, driven = modelled(controls, steady)
        driven[place] += 0.05
        for _ in range(20):
            model.step(driven, state)
        assert state[rate] < -0.005


def test_wind_carries_it(controls: Controls, steady: Steady) -> None:
    """In a tail wind that grows slowly the aircraft gets as fast over the ground as the wind."""
    model, state, driven = modelled(controls, steady)
    for n in range(8000):
        driven[4] = min(5.0, n * 0.001)
        model.step(driven, state)
    assert state[3] == pytest.approx(V + 5.0, abs=1.0)


def test_a_model_that_fails_says_why_and_raises_nothing(
    controls: Controls, steady: Steady, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, state, driven = modelled(controls, steady)

    class Broken:
        def run(self) -> None:
            raise RuntimeError("the engine\n fell off")

        def __setitem__(self, name: str, value: float) -> None: ...

        def __getattr__(self, name: str) -> object:
            return getattr(whole, name)

    whole = model.model
    monkeypatch.setattr(model, "model", Broken())
    model.step(driven, state)
    assert model.trouble == "the engine fell off"
    assert np.isnan(state[: len(ModelState._fields)]).all()


def test_numbers_beyond_all_bounds_become_a_state_that_is_not_finite(controls: Controls, steady: Steady) -> None:
    model, state, driven = modelled(controls, steady)
    driven[4] = 1e300
    for _ in range(3):
        model.step(driven, state)
    assert not np.isfinite(state).all()


def test_modes_of_the_trainer(controls: Controls) -> None:
    """Of the order of a light aircraft's, and each with its name."""
    found = {mode.name: mode for mode in linear_modes(TRAINER, controls, V, ALTITUDE)}
    assert 5.0 < found["short period"].frequency < 8.0
    assert 0.15 < found["phugoid"].frequency < 0.35
    assert -8.0 < found["roll"].eigenvalue.real < -5.0
    assert 1.5 < found["Dutch roll"].frequency < 3.0


def test_a_glider_has_no_thrust_and_a_ball_nothing() -> None:
    assert controls_of(Aircraft("sgs126"), 25.0, ALTITUDE).missing == ("thrust",)
    ball = Aircraft("ball")
    assert controls_of(ball, 30.0, ALTITUDE).missing == ("aileron", "elevator", "rudder", "thrust")
    with pytest.raises(TrimError, match="ball has no level flight at 30 m/s and 1000 m"):
        steady_flight(ball, controls_of(ball, 30.0, ALTITUDE), 30.0, ALTITUDE)


def test_a_speed_at_which_it_cannot_fly_is_refused(controls: Controls) -> None:
    with pytest.raises(TrimError, match="c172p has no level flight at 20 m/s"):
        steady_flight(TRAINER, controls, 20.0, ALTITUDE)


def test_the_step_is_never_longer_than_its_aircraft_allow() -> None:
    assert [parts_of(step) for step in (1000, 8333, 8334, 20_000)] == [1, 1, 2, 3]
    assert load(TRAINER, 20_000).get_delta_t() == pytest.approx(0.02 / 3.0)


def test_nothing_is_printed_and_no_socket_opened(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where JSBSim loads them itself, the 737 listens on two ports and the business jet writes a table."""
    monkeypatch.chdir(tmp_path)
    for name in ("737", "global5000"):
        load(Aircraft(name)).run_ic()
    assert capfd.readouterr() == ("", "")
    assert not [
        one for one in psutil.Process().net_connections() if one.status == "LISTEN" and one.laddr.port in (5138, 5139)
    ]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<fdm_config><metrics></fdm_config>", "is no XML: mismatched tag"),
        ("<airplane/>", "its root is <airplane>, must be <fdm_config>"),
        ("<fdm_config/>", "mine"),
    ],
)
def test_a_file_that_is_no_aircraft_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "mine.xml"
    file.write_text(text)
    with pytest.raises(JsbsimError, match=message) as refused:
        load(Aircraft(str(file)))
    assert "\n" not in str(refused.value)


def test_names_and_properties_that_do_not_exist_are_refused(tmp_path: Path) -> None:
    with pytest.raises(JsbsimError, match=r"JSBSim has no aircraft 'c171'; it has .*c172p"):
        load(Aircraft("c171"))
    with pytest.raises(JsbsimError, match="there is no such file"):
        load(Aircraft(str(tmp_path / "none.xml")))
    with pytest.raises(JsbsimError, match="c172p: has no property fuel/on-the-moon"):
        load(Aircraft("c172p", (("fuel/on-the-moon", 1.0),)))


def test_without_the_package_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "jsbsim", None)
    with pytest.raises(JsbsimError, match=r"JSBSim is not installed: pip install 'ftcc-sitl\[jsbsim\]'"):
        loading.package()


def test_properties_reach_the_bench() -> None:
    light = Aircraft("c172p", (("inertia/pointmass-weight-lbs", 0.0),))
    bench, full = Bench(light), Bench(TRAINER)
    for one in (bench, full):
        one.set(Pose(V, ALTITUDE), Commands(throttle=0.6))
    lighter, heavier = bench.read("inertia/weight-lbs"), full.read("inertia/weight-lbs")
    assert lighter is not None
    assert heavier is not None
    assert lighter < heavier - 100.0


def test_a_measurement_does_not_depend_on_those_before() -> None:
    fresh, used = Bench(TRAINER), Bench(TRAINER)
    for wild in (Pose(20.0, 10.0, 0.5, 0.3, 1.0), Pose(90.0, 3000.0, -0.2, q=0.5)):
        used.set(wild, Commands(-0.5, 0.5, 1.0, 1.0))
    for bench in (fresh, used):
        bench.set(Pose(V, ALTITUDE, 0.02), Commands(throttle=0.6))
    assert used.accelerations() == pytest.approx(fresh.accelerations(), abs=1e-6)


def test_turbulence_of_jsbsims_own_is_drawn_by_the_seed() -> None:
    rough = Aircraft("c172p", (("atmosphere/turb-type", 4.0), ("atmosphere/turbulence/milspec/severity", 4.0)))
    controls = controls_of(rough, V, ALTITUDE)
    steady = steady_flight(rough, controls, V, ALTITUDE)
    ends = []
    for seed in (1, 1, 2):
        model = Modelled(FlownAircraft(rough, controls, HOME, ALTITUDE, 5000, seed), 1)
        pose = body_attitude(0.0, 0.0, steady.mu, steady.alpha, 0.0)
        state = np.array([0.0, 0.0, ALTITUDE - HOME[2], V, 0.0, 0.0, *pose, 0.0, 0.0, 0.0])
        driven = np.array([steady.aileron, steady.elevator, steady.rudder, steady.thrust, 0.0, 0.0, 0.0])
        model.begin(state, driven)
        for _ in range(400):
            model.step(driven, state)
        ends.append(state)
    same, again, other = ends
    assert np.isfinite(ends).all()
    assert (same == again).all()
    assert np.abs(other - same).max() > 0.01
