"""JSBSim as the referee of our equations of motion: the same aircraft, the same controls, the same flight."""

from __future__ import annotations

import functools
import math
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside.jsbsim import Actuator, write_aircraft
from ftcc.link.actuators import ACTUATORS
from ftcc.link.airframe import Airframe
from ftcc.sim.linear_modes import LATERAL, LONGITUDINAL, STATES, linearize
from ftcc.sim.trim import trim
from tests.support import referee, referee_trim
from tests.support.referee import AIRFRAME, CASES, NAME, SHEET, STILL, Case, Jump, Track, apart, doublet

pytestmark = pytest.mark.skipif(find_spec("jsbsim") is None, reason="JSBSim is not installed (extra jsbsim)")

NEAR, NEAR_IN_MOVING_AIR = 3e-4, 3e-3
"""m, after 400 m of flight; found are 0.07 mm at most, and 0.8 mm where the wind jumps."""
AIMED, AIMED_IN_MOVING_AIR = 1e-4, 1e-3
"""deg; found are 2.5e-5 and 5e-4 at most."""


@functools.cache
def ours(case: Case) -> Track:
    return referee.fly_ours(case)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_after_twenty_seconds_both_are_at_the_same_place(case: Case) -> None:
    found = apart(ours(case), referee.fly_jsbsim(case))
    moving = case.gust is not None or any(jump.what == "wind" for jump in case.jumps)
    assert found.position.max() < (NEAR_IN_MOVING_AIR if moving else NEAR)
    assert found.attitude.max() < (AIMED_IN_MOVING_AIR if moving else AIMED)
    assert found.velocity[-1] < 3e-4
    assert found.rates[-1] < 1e-3


TURN = next(case for case in CASES if case.name == "turn and climb")
CHANGED = [name for name in Airframe._fields if name != "g" and getattr(AIRFRAME, name) != 0.0]


@pytest.mark.parametrize("name", CHANGED)
def test_the_referee_would_see_one_per_cent_of_any_parameter(name: str, tmp_path: Path) -> None:
    """So none of them is left out, wrong in sign or at the wrong place on either side."""
    wrong = SHEET.model_copy(update={name: 1.01 * getattr(SHEET, name)})
    write_aircraft(wrong, NAME, tmp_path, actuators=STILL)
    found = apart(ours(TURN), referee.fly_jsbsim(TURN, folder=tmp_path))
    assert found.position.max() > 10.0 * NEAR


def test_the_sign_of_the_product_of_inertia_counts(tmp_path: Path) -> None:
    write_aircraft(SHEET.model_copy(update={"Ixz": -SHEET.Ixz}), NAME, tmp_path, actuators=STILL)
    assert apart(ours(TURN), referee.fly_jsbsim(TURN, folder=tmp_path)).position.max() > 1.0


def test_coefficients_that_are_zero_here_act_alike_elsewhere(tmp_path: Path) -> None:
    """An aircraft that is not symmetric: CY0, Cl0, Cn0."""
    crooked = {"CY0": 0.004, "Cl0": -0.0004, "Cn0": 0.0005}
    write_aircraft(SHEET.model_copy(update=crooked), NAME, tmp_path, actuators=STILL)
    case = Case("", doublet("elevator", 0.05), seconds=10.0)
    mine = referee.fly_ours(case, airframe=AIRFRAME._replace(**crooked))
    assert abs(mine.position[-1, 1]) > 3.0
    assert apart(mine, referee.fly_jsbsim(case, folder=tmp_path)).position.max() < NEAR


@pytest.mark.parametrize("V", [18.0, 25.0, 30.0, 35.0])
def test_the_trim_is_where_jsbsims_accelerations_vanish(V: float) -> None:
    assert referee_trim.jsbsim_trim(V) == pytest.approx(trim(AIRFRAME, V), rel=1e-5)


@pytest.mark.parametrize("V", [18.0, 25.0, 30.0, 35.0])
def test_the_linear_modes_are_those_of_jsbsims_accelerations(V: float) -> None:
    """Eigenvalues, of differences of accelerations there, of rates of our states here."""
    matrix = linearize(AIRFRAME, V)
    mine: list[complex] = []
    for names in (LONGITUDINAL, LATERAL):
        part = [STATES.index(name) for name in names]
        mine += [complex(one) for one in np.linalg.eigvals(matrix[np.ix_(part, part)])]
    theirs = [complex(one) for one in np.linalg.eigvals(referee_trim.jsbsim_matrix(V))]
    for mode in mine:
        nearest = min(theirs, key=lambda one: abs(one - mode))
        assert nearest == pytest.approx(mode, rel=2e-5, abs=1e-6)


LAGGED = {name: Actuator(-0.5, 0.5, lag=20.0) for name in ACTUATORS} | {"thrust": Actuator(0.0, 60.0, lag=5.0)}
LIMITED = {name: Actuator(-0.5, 0.5, lag=20.0, rate=0.6) for name in ACTUATORS} | {
    "thrust": Actuator(0.0, 60.0, lag=5.0, rate=10.0)
}
SLOW = {name: Actuator(-0.5, 0.5, rate=0.5) for name in ACTUATORS} | {"thrust": Actuator(0.0, 60.0, rate=10.0)}
MOVES = Case(
    "surfaces that saturate",
    (
        *doublet("elevator", 0.1),
        *doublet("aileron", 0.15, 1.5, 0.5),
        *doublet("rudder", 0.9, 2.0, 0.6),
        Jump(1.0, "thrust", 60.0),
        Jump(3.0, "thrust", -60.0),
    ),
)


@pytest.mark.parametrize(
    ("actuators", "share"),
    [(LAGGED, 0.5), (LIMITED, 0.0), (SLOW, 0.0)],
    ids=["lag", "lag and rate limit", "rate limit"],
)
def test_actuators_move_alike(actuators: dict[str, Actuator], share: float, tmp_path: Path) -> None:
    """Beyond their travel too: the command is limited, then the lag follows it."""
    write_aircraft(SHEET, NAME, tmp_path, actuators=actuators)
    found = apart(
        referee.fly_ours(MOVES, actuators), referee.fly_jsbsim(MOVES, folder=tmp_path, actuators=actuators, share=share)
    )
    assert found.position.max() < NEAR_IN_MOVING_AIR
    assert found.attitude.max() < AIMED_IN_MOVING_AIR


def test_a_finer_step_changes_nothing_that_counts() -> None:
    """Both have converged at 1 ms; what is left is the roundness of a planet of 10^10 m, and rounding there."""
    half = apart(referee.fly_jsbsim(TURN), referee.fly_jsbsim(TURN, dt=0.0005))
    assert half.position.max() < 1e-3
    assert apart(ours(TURN), referee.fly_ours(TURN, step_us=500)).position.max() < 1e-6


def test_jsbsims_table_of_units_would_be_seen(tmp_path: Path) -> None:
    """Why the aircraft is written in its own units."""
    referee.write_in_si(tmp_path)
    found = apart(ours(TURN), referee.fly_jsbsim(TURN, folder=tmp_path))
    assert 10.0 * NEAR < found.position.max() < 0.1


def test_jsbsims_own_program_flies_what_is_written(tmp_path: Path) -> None:
    """``jsbsim --root=. --script=aircraft/NAME/fly_25.xml``."""
    write_aircraft(SHEET, NAME, tmp_path / "aircraft", actuators=STILL, airspeeds=[25.0])
    program = "import sys; from jsbsim.script import main; sys.exit(main())"
    script = f"--script=aircraft/{NAME}/fly_25.xml"
    flown = subprocess.run(
        [sys.executable, "-c", program, "--root=.", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert flown.returncode == 0, flown.stdout + flown.stderr
    rows = np.loadtxt(tmp_path / f"{NAME}_25.csv", delimiter=",", skiprows=1)
    assert rows[-1, 0] == pytest.approx(20.0)
    assert rows[:, 1] * referee.FOOT == pytest.approx(25.0, abs=1e-4)
    assert rows[:, 4] == pytest.approx(1000.0, abs=1e-3)


def test_it_starts_where_it_is_told_to() -> None:
    """Bank, sideslip and rates at the start, by the conventions of both."""
    state = referee.start_of(TURN)[1]._replace(chi=0.7, gamma=0.1, mu=-0.4, alpha=0.1, beta=0.05, p=0.2, q=-0.1, r=0.15)
    aircraft = referee.Jsbsim(referee.aircraft_folder(), NAME)
    aircraft.start(state, dict.fromkeys(("aileron", "elevator", "rudder", "throttle"), 0.0))
    assert aircraft.fdm["aero/alpha-rad"] == pytest.approx(state.alpha, abs=1e-12)
    assert aircraft.fdm["aero/beta-rad"] == pytest.approx(state.beta, abs=1e-12)
    assert aircraft.fdm["flight-path/gamma-rad"] == pytest.approx(state.gamma, abs=1e-12)
    assert math.atan2(aircraft.row[4], aircraft.row[3]) == pytest.approx(state.chi, abs=1e-12)
    assert aircraft.row[9:] == pytest.approx((state.p, state.q, state.r), abs=1e-12)
