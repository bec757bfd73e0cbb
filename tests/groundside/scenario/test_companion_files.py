"""A scenario in several files: NAME.toml, NAME.variants.toml, NAME.claims.toml; tables; where values come from."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside.scenario import ScenarioError, forms_and_variants, load, read, resolve, shipped, summary
from ftcc.groundside.scenario.claim_tables import FIELDS, claims_in
from ftcc.groundside.scenario.places import line_of
from ftcc.groundside.schema import Claim
from ftcc.groundside.simulation import cases_of

DEMO = shipped()["demo"]
CLAIM = """
[[claims]]
name = "mine"
metric = "max_abs"
signal = "z - z_r"
window = [0.0, 1.0]
source = "mine"
expected = { "flight+slow" = 1.0 }
tolerance = "< 2"
"""
TABLE = """
[[table]]
source = "table 1"
unit = "m"
columns = [
     "part",  "name", "metric",  "signal", "window",   "flight", "flight+slow", "tolerance",
]
rows = [
    ["row 1", "a",    "max_abs", "z",      [0.0, 1.0], 1.0,      2.0,           "1 %"],
    # A comment.
    ["row 2", "b",    "max",     "z",      [0.0, 2.0], "",       3.0,           "1 %"],
]
"""


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """A copy of the demo alone, with a variant."""
    path = tmp_path / "mine.toml"
    path.write_text(DEMO.read_text() + '\n[variant.slow]\ntitle = "slow"\nrates = { exchange_rate = 10.0 }\n')
    return path


def beside(path: Path, **texts: str) -> Path:
    for kind, text in texts.items():
        path.with_suffix(f".{kind}.toml").write_text(text)
    return path


def refusal(path: Path, **options: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        resolve(load(path, **options))
    return str(caught.value)


# --- reading ---------------------------------------------------------------------------------------------------------


def test_a_scenario_is_its_file_with_the_variants_and_claims_beside_it(mine: Path) -> None:
    beside(mine, variants='[variant.lossy]\ntitle = "lossy"\nchannel = { loss = 0.3 }\n', claims=CLAIM + TABLE)
    scenario = load(mine, variants=["lossy", "slow"])
    assert (scenario.case, scenario.plan.channel.loss) == ("flight+slow+lossy", 0.3)
    assert [claim.name for claim in scenario.plan.claims] == ["mine", "a", "b"]
    assert [path.name for path in scenario.files] == ["mine.toml", "mine.variants.toml", "mine.claims.toml"]
    assert set(read(mine)["variant"]) == set(summary(mine).variants) == {"slow", "lossy"}
    assert load(mine, variants=["slow"], settings=["claims=[]"]).plan.claims == []


def test_a_copy_of_a_shipped_scenario_flies_alone_and_with_copies_of_what_stands_beside_it(tmp_path: Path) -> None:
    shutil.copy(shipped()["containment"], tmp_path / "mine.toml")
    alone = load(tmp_path / "mine.toml", variants=["off"])
    assert list(forms_and_variants(alone.source)[1]) == ["P", "off", "loss30"]
    assert (alone.plan.claims, resolve(alone).case) == ([], "flight+off")
    for kind in ("variants", "claims", "study", "diagnosis"):
        shutil.copy(shipped()["containment"].with_suffix(f".{kind}.toml"), tmp_path / f"mine.{kind}.toml")
    assert load(tmp_path / "mine.toml").plan == load("containment").plan


def test_a_run_holds_all_of_it_in_one_file(mine: Path, tmp_path: Path) -> None:
    flown = resolve(load(beside(mine, claims=TABLE), variants=["slow"]))
    run = tmp_path / "run"
    run.mkdir()
    (run / "scenario.toml").write_text(flown.toml)
    (run / "scenario.claims.toml").write_text(CLAIM)
    assert resolve(load(run)).claims == flown.claims, "whatever lies beside it"


def test_order_decides_in_which_order_variants_are_merged_and_named(mine: Path) -> None:
    fast = '[variant.fast]\ntitle = "fast"\nrates = { exchange_rate = 50.0 }\n'
    beside(mine, variants=fast)
    both = load(mine, variants=["slow", "fast"])
    assert (both.case, both.plan.rates.exchange_rate) == ("flight+slow+fast", 50.0)
    beside(mine, variants=f'order = ["fast"]\n{fast}')
    both = load(mine, variants=["slow", "fast"])
    assert (both.case, both.plan.rates.exchange_rate) == ("flight+fast+slow", 10.0)


def test_companion_files_are_no_scenarios(mine: Path) -> None:
    assert [name for name in shipped() if "." in name] == []
    claims = beside(mine, claims=CLAIM).with_suffix(".claims.toml")
    assert "part of mine.toml" in refusal(claims)


@pytest.mark.parametrize("name", shipped())
def test_shipped_scenarios_are_what_flies(name: str) -> None:
    text = shipped()[name].read_text()
    assert text.count("\n") <= 120
    assert "[[claims]]" not in text
    cases = cases_of(load(name))
    assert len(cases) > 1 or name in ("demo", "active")


# --- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("texts", "fragments"),
    [
        (
            {"claims": "\nduration = 3.0\n"},
            ["mine.claims.toml:2: duration: only claims and table may stand", "mine.toml"],
        ),
        ({"variants": CLAIM}, ["mine.variants.toml:2: claims: only variant and order may stand"]),
        ({"variants": '\n[variant.slow]\ntitle = "x"\n'}, ["mine.variants.toml:2: variant.slow: stands in mine.toml"]),
        ({"variants": 'order = ["quick"]\n'}, ["mine.variants.toml:1: order = ['quick']: must be names of variants"]),
        ({"variants": "variant = 3\n"}, ["mine.variants.toml:1: variant = 3: must be tables"]),
        ({"claims": "claims = 3\n"}, ["mine.claims.toml:1: claims = 3: must be tables"]),
        ({"claims": "[[claims]"}, ["mine.claims.toml: not a TOML file"]),
        ({"claims": CLAIM.replace("z_r", "z_q")}, ["mine.claims.toml:2: claims.0 (mine): signal", "no column z_q"]),
        ({"claims": CLAIM.replace('"max_abs"', "3")}, ["mine.claims.toml:4: claims.0.metric = 3: must be"]),
        ({"claims": CLAIM.replace("slow", "slwo")}, ["mine.claims.toml:8: claims.0.expected: case 'flight+slwo'"]),
        (
            {"claims": TABLE.replace('"max",', '"most",')},
            ["mine.claims.toml:11: table.0.rows.1 (b): there is no metric"],
        ),
        ({"claims": TABLE.replace("2.0,   ", "")}, ["mine.claims.toml:9: table.0.rows.0: has 7; must be 8 entries"]),
        ({"claims": TABLE.replace("3.0, ", '"",')}, ["mine.claims.toml:11: table.0.rows.1: expects nothing"]),
        ({"claims": TABLE.replace('"flight",', '"name",')}, ["mine.claims.toml:5: table.0.columns: a name stands"]),
        ({"claims": "[[table]]\nrows = []\n"}, ["mine.claims.toml:1: table.0.columns: must be a list"]),
    ],
)
def test_every_problem_names_the_file_and_the_line_it_stands_in(
    mine: Path, texts: dict[str, str], fragments: list[str]
) -> None:
    text = refusal(beside(mine, **texts))
    for fragment in fragments:
        assert fragment in text


def test_problems_of_the_scenario_itself_and_of_options_name_their_places(mine: Path) -> None:
    line = line_of(mine.read_text(), ("graph", "edges", "3"))
    mine.write_text(mine.read_text().replace("between = [3, 4]", "between = [3, 9]"))
    assert line is not None
    assert "[3, 9]" in mine.read_text().splitlines()[line - 1]
    assert f"mine.toml:{line}: graph.edges.3: there is no UAV 9" in refusal(mine)
    assert "(--set duration=-1)" in refusal(DEMO, settings=["duration=-1"])
    mine.write_text('order = ["slow"]\n' + mine.read_text())
    assert "mine.toml:1: order: only mine.variants.toml has one" in refusal(mine)


# --- tables of claims ------------------------------------------------------------------------------------------------


def test_a_table_whose_columns_are_names_has_a_claim_in_each_row() -> None:
    table = {
        "source": "table 1",
        "unit": "m",
        "columns": ["part", "name", "window", "flight", "flight+off"],
        "rows": [["row 1", "a", [0.0, 1.0], 1.0, 2.0], ["", "b", [0.0, 2.0], "", [3.0, 4.0]]],
    }
    assert [claim for _, claim in claims_in(table)] == [
        {"source": "table 1, row 1", "unit": "m", "name": "a", "window": [0.0, 1.0]}
        | {"expected": {"flight": 1.0, "flight+off": 2.0}},
        {"source": "table 1", "unit": "m", "name": "b", "window": [0.0, 2.0], "expected": {"flight+off": [3.0, 4.0]}},
    ]


def test_each_row_may_name_its_one_case() -> None:
    table = {"columns": ["name", "case", "expected"], "rows": [["a", "flight", 1.0], ["b", "flight+off", 2.0]]}
    assert [claim["expected"] for _, claim in claims_in(table)] == [{"flight": 1.0}, {"flight+off": 2.0}]


def test_a_table_whose_columns_are_claims_has_a_case_in_each_row() -> None:
    table = {
        "metric": "max",
        "columns": [{"name": "a", "tolerance": "1 %"}, {"name": "b", "tolerance": "2 %", "metric": "min"}],
        "rows": {"flight": [1.0, 2.0], "flight+off": ["", 3.0]},
    }
    assert list(claims_in(table)) == [
        (("columns", "0"), {"metric": "max", "name": "a", "tolerance": "1 %", "expected": {"flight": 1.0}}),
        (
            ("columns", "1"),
            {"metric": "min", "name": "b", "tolerance": "2 %", "expected": {"flight": 2.0, "flight+off": 3.0}},
        ),
    ]


def test_columns_may_be_all_fields_of_a_claim() -> None:
    assert {*FIELDS, "expected"} == set(Claim.model_fields)


# --- where values come from ------------------------------------------------------------------------------------------


def test_where_a_value_came_from() -> None:
    scenario = load("containment", variants=["P", "noise"], settings=["plant.delay=1"], seed=3)
    places = scenario.places.of
    assert {key: place.layer for key, place in places("plant.lag").items()} == {
        "plant.lag.elevator": "variant P",
        "plant.lag.thrust": "variant P",
    }
    assert places("rates.exchange_rate")["rates.exchange_rate"].layer == "form flight"
    assert places("plant.delay")["plant.delay"].layer == "--set plant.delay=1"
    assert places("seed")["seed"].layer == "--seed"
    assert places("channel.loss") == {}, "the default"
    assert places("faults.7") == places("plant.limits.thrust.0.x") == {}
    for key, file in (("noise.factor", "containment.variants.toml"), ("noise.q", "containment.toml")):
        (place,) = places(key).values()
        assert place.file is not None
        assert (place.file.name, place.line is not None) == (file, True)
        assert re.search(rf"\b{key.split('.')[1]} = ", place.file.read_text().splitlines()[place.line - 1])


@pytest.mark.parametrize("name", shipped())
def test_the_line_of_every_claim_is_known(name: str) -> None:
    scenario = load(name)
    for n, claim in enumerate(scenario.plan.claims):
        place = scenario.places.of(f"claims.{n}.name")[f"claims.{n}.name"]
        assert place.file is not None
        line = place.file.read_text().splitlines()[place.line - 1]
        assert f'"{claim.name}"' in line or line == "[[table.columns]]", (claim.name, line)


def test_calibrated_thresholds_are_below_all_else(mine: Path) -> None:
    beside(mine, diagnosis="[diagnosis.gains]\nlimit_elevator = 0.5\nlimit_thrust = 6.0\n")
    given = {"diagnosis": {"gains": {"limit_thrust": 7.0}}}
    assert load(mine).plan.diagnosis.gains.given == {"limit_elevator": 0.5, "limit_thrust": 6.0}
    assert load(mine, changes=given).plan.diagnosis.gains.given == {"limit_elevator": 0.5, "limit_thrust": 7.0}
    scenario = load(mine, settings=["diagnosis.gains.limit_elevator=0.1", "diagnosis.on=true"])
    assert scenario.plan.diagnosis.gains.given == {"limit_elevator": 0.1, "limit_thrust": 6.0}
    assert scenario.places is not None
    (place,) = scenario.places.of("diagnosis.gains.limit_thrust").values()
    assert (place.layer, place.line) == ("calibrated thresholds", 3)
    assert "mine.diagnosis.toml" not in [*shipped()]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[diagnosis]\non = true\n", ":1: diagnosis: only [diagnosis.gains] may stand in this file"),
        ("duration = 3.0\n", ":1: duration: only diagnosis may stand in this file; the rest belongs into mine.toml"),
        ("[diagnosis.gains]\nlimit_rudder = -1.0\n", ":1: diagnosis.gains: limit_rudder = -1: must be"),
        ("[diagnosis.gains]\nlimit = 1.0\n", "there is no setting limit; there are"),
    ],
)
def test_wrong_thresholds_are_refused_with_their_line(mine: Path, text: str, problem: str) -> None:
    beside(mine, diagnosis=text)
    assert problem in refusal(mine, settings=["diagnosis.on=true"])


def test_lines_are_counted_through_lists_quotes_and_comments() -> None:
    text = '# [a]\nx = """\n[b]\n"""\n[a."b.c"]\ny = [\n    [1],\n\n    # no\n    [2],\n]\n'
    text += "[[d]]\n[[d]]\nz.w = 1\n[d.e]\nv = 2\n"
    lines = {
        ("x",): 2,
        ("a",): 5,
        ("a", "b.c"): 5,
        ("a", "b.c", "y"): 6,
        ("a", "b.c", "y", "1"): 10,
        ("d", "0"): 12,
        ("d", "1", "z", "w"): 14,
        ("d", "1", "e", "v"): 16,
        ("b",): None,
    }
    assert {path: line_of(text, path) for path in lines} == lines
