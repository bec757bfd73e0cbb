"""Maps: their axes, the boundary of level trim beside the check's own refusal, margins, pictures, refusals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ftcc.groundside.cli.app import main
from ftcc.groundside.errors import UserError
from ftcc.groundside.scenario import ScenarioError, load, resolve, trims_under_faults
from ftcc.groundside.studies import Map, axis_of, check_claim, draw_map, open_folder, plan_map
from ftcc.groundside.studies.flying import Outcome
from ftcc.groundside.studies.folder import save_plan
from ftcc.groundside.studies.rows import table_of, write_table

X, Y = axis_of("faults.0.effectiveness=0.1:0.9:5", "--x"), axis_of("faults.0.bias=-0.6:0.6:4", "--y")


@pytest.fixture(scope="module")
def planned() -> Any:
    return plan_map("demo", X, Y, settings=["faults.0.at=2"], duration=5.0)


def landed(planned: Any, folder: Path, of: Any) -> Path:
    """A folder with a table of flights that need not be flown."""
    plan, _ = planned
    place = open_folder(plan, folder)
    save_plan(plan, place)
    write_table(table_of(plan, [of(n) for n in range(plan.count)]), place)
    return place


def good(n: int) -> Outcome:
    return Outcome(n, values=(), holds=(), verdict="as it should be", end_margin=0.5)


def test_an_axis_has_both_ends_and_decimal_values() -> None:
    assert axis_of("a.b=0.1:0.4:4", "--x").values == (0.1, 0.2, 0.3, 0.4)
    assert axis_of("a.b=-1:1:3", "--x").key == "a.b"


@pytest.mark.parametrize(
    "text", ["a.b", "a.b=1:2", "a.b=x:2:3", "a.b=0:1:2.5", "a.b=1:0:3", "a.b=0:inf:3", "a.b=0:1:1", "=0:1:2"]
)
def test_an_axis_without_three_numbers_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="--x"):
        axis_of(text, "--x")


def test_the_trim_boundary_is_where_the_check_refuses() -> None:
    """On both sides of both boundaries, at a ten-thousandth of the travel."""
    (demand, *_) = trims_under_faults(load("demo"))[0]
    for effectiveness in (0.3, 0.7):
        for end, inward in ((demand.low, 1.0), (demand.high, -1.0)):
            for shift, allowed in ((1e-4 * inward, True), (-1e-4 * inward, False)):
                bias = demand.needed - effectiveness * (end + shift)
                assert (demand.margin(effectiveness, bias) > 0.0) is allowed
                scenario = load("demo", settings=[f"faults.0.effectiveness={effectiveness}", f"faults.0.bias={bias}"])
                if allowed:
                    resolve(scenario)
                else:
                    with pytest.raises(ScenarioError, match="no level trim"):
                        resolve(scenario)


def test_a_dead_actuator_has_a_trim_only_where_level_flight_needs_it() -> None:
    (demand, *_) = trims_under_faults(load("demo"))[0]
    assert demand.margin(0.0, demand.needed) == 1.0
    assert demand.margin(0.0, demand.needed + 0.01) <= 0.0


def test_faults_of_the_axes_fly_without_trim(planned: Any) -> None:
    plan, faults = planned
    assert faults == (0,)
    assert all(plan.drawn(plan.trial(n))[1] is not None for n in range(plan.count))


def test_a_map_lies_as_its_axes_say_and_tells_lost_from_refused(planned: Any, tmp_path: Path) -> None:
    plan, _ = planned
    outcomes = {
        plan.combinations.index((X.values[1], Y.values[0])): Outcome(0, verdict="failed", lost=(1,), error="lost"),
        plan.combinations.index((X.values[2], Y.values[3])): Outcome(0, refused=True, error="no"),
        plan.combinations.index((X.values[4], Y.values[2])): Outcome(0, verdict="failed", end_margin=-3.0),
    }
    fields = lambda n: outcomes.get(n, good(n))  # noqa: E731
    flown = Map(landed(planned, tmp_path / "map", lambda n: Outcome(**{**vars(fields(n)), "number": n})))
    expected = np.full((4, 5), 0.5)
    expected[0, 1], expected[3, 2], expected[2, 4] = -np.inf, np.nan, -3.0
    np.testing.assert_array_equal(flown.margins, expected)
    assert np.argwhere(flown.refused).tolist() == [[3, 2]]
    assert flown.trimmed is not None
    beyond = int(((flown.margins >= 0.0) & ~flown.trimmed).sum())
    text = "\n".join(flown.sentences())
    assert "holds in 17 of 19 cells" in text
    assert "1 cells were refused" in text
    assert f"it holds in {beyond} cells beyond the trim boundary" in text


def test_cells_with_a_trim_are_those_that_the_check_lets_fly(planned: Any, tmp_path: Path) -> None:
    flown = Map(landed(planned, tmp_path / "map", good))
    assert flown.trimmed is not None
    for column, x in enumerate(X.values):
        for row, y in enumerate(Y.values):
            scenario = load("demo", settings=[f"{X.key}={x}", f"{Y.key}={y}", "faults.0.at=2"], duration=5.0)
            try:
                resolve(scenario)
            except ScenarioError:
                assert not flown.trimmed[row, column]
            else:
                assert flown.trimmed[row, column]
    (curve,) = (one for one in flown.curves if one.trim)
    assert curve.height.shape == (len(curve.y), len(curve.x))
    assert curve.height.min() < 0.0 < curve.height.max()


def test_a_condition_of_the_law_is_drawn_where_an_axis_crosses_it(tmp_path: Path) -> None:
    """Theorem 5.1: beta2 must exceed the leaders' climb rate."""
    x, y = axis_of("gains.beta2=0.5:8:6", "--x"), axis_of("gains.k42=1:2:2", "--y")
    planned = plan_map("containment", x, y, duration=200.0)
    flown = Map(landed(planned, tmp_path / "map", good))
    (curve,) = (one for one in flown.curves if "Theorem 5.1" in one.label)
    assert curve.height[0, 0] < 0.0 < curve.height[0, -1]


def test_equal_maps_have_equal_pictures(planned: Any, tmp_path: Path) -> None:
    flown = Map(landed(planned, tmp_path / "map", lambda n: Outcome(n, verdict="failed", end_margin=0.1 * (n - 9))))
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        names = [path.name for path in draw_map(flown, tmp_path / folder)]
    assert names == ["map.svg", "map.pdf", "map.png"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_a_claim_must_be_there_and_end_with_the_flight(planned: Any) -> None:
    plan, _ = planned
    with pytest.raises(UserError, match="there is no claim 'nothing'"):
        check_claim(plan, "nothing")
    with pytest.raises(UserError, match="ends after the flight"):
        check_claim(plan, plan.claims[-1].name)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--x", "faults.0.nothing=0:1:3", "--y", "faults.0.bias=0:1:3"], "no such field"),
        (["--x", "faults.0.bias=a:b:3", "--y", "faults.0.bias=0:1:3"], "--x faults.0.bias=a:b:3"),
        (["--x", "faults.0.bias=0:1:3", "--y", "faults.0.bias=0:1:3"], "needs two keys"),
        (["--x", "faults.9.bias=0:1:3", "--y", "faults.0.bias=0:1:3"], "9 is none of them"),
    ],
)
def test_bad_input_ends_with_code_2(
    options: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["ftcc", "map", "demo", *options])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_the_list_of_commands_has_it(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.argv", ["ftcc", "--help"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    assert "Draw where a claim holds" in capsys.readouterr().out
