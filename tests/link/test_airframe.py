"""The list of an aircraft's parameters stands once; truth, nominal model and sheet derive theirs from it."""

from __future__ import annotations

import ast
import pickle
from pathlib import Path

import pytest

from ftcc.airside.model import Model
from ftcc.groundside.schema import AirframeSheet, PointMassSheet
from ftcc.link.airframe import Airframe, PointMass, parameters
from ftcc.sim.plants import find, names

REPOSITORY = Path(__file__).parents[2]
COEFFICIENTS = {name for name in Airframe._fields + PointMass._fields if len(name) > 1}
"""Names of one letter are those of other things too."""


def listed(path: Path) -> set[str]:
    """The coefficients that a file names as fields of a class or in strings, as a list of them would."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef):
            found |= {entry.target.id for entry in node.body if isinstance(entry, ast.AnnAssign)}  # type: ignore[union-attr]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.add(node.value)
    return found & COEFFICIENTS


def test_only_one_file_lists_the_coefficients():
    sources = [path for wing in ("airside", "sim", "link", "groundside") for path in (REPOSITORY / wing).rglob("*.py")]
    lists = {str(path.relative_to(REPOSITORY)): listed(path) for path in sources}
    home = lists.pop("link/airframe.py")
    assert home == COEFFICIENTS
    # The equations once more, for JSBSim; `coefficients` there refuses one without a term.
    assert lists.pop("groundside/jsbsim/terms.py") == COEFFICIENTS & {*Airframe._fields}
    # Single ones may be named, such as those of the polar that a law knows of a point mass.
    assert {path: sorted(found) for path, found in lists.items() if len(found) > 2} == {}


@pytest.mark.parametrize("record", [Airframe, PointMass])
def test_every_parameter_has_a_unit_and_a_meaning(record):
    assert tuple(parameters(record)) == record._fields
    assert all(parameter.unit and parameter.meaning for parameter in parameters(record).values())


@pytest.mark.parametrize("plant", names())
def test_a_plant_has_the_parameters_of_its_aircraft(plant):
    assert find(plant).Parameters in (Airframe, PointMass)


@pytest.mark.parametrize(("record", "sheet"), [(Airframe, AirframeSheet), (PointMass, PointMassSheet)])
def test_a_sheet_asks_for_every_parameter_in_its_range(record, sheet):
    assert set(sheet.model_fields) == {"title", "T_max", *record._fields}
    for name, parameter in parameters(record).items():
        field = sheet.model_fields[name]
        assert field.is_required()
        assert parameter.unit in field.description
    complete = dict.fromkeys(("T_max", *record._fields), 1.0)
    sheet(**complete)
    for wrong in ({"m": 0.0}, {"CD0": -0.01}, {"S": float("nan")}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            sheet(**complete | wrong)


def test_a_law_knows_the_parameters_and_the_limits_and_has_no_value_of_its_own():
    assert Model._fields[: len(Airframe._fields)] == Airframe._fields
    assert Model._field_defaults == {}
    model = Model(*map(float, range(len(Model._fields))))
    assert pickle.loads(pickle.dumps(model)) == model
    assert (model.m, model.lag) == (0.0, len(Model._fields) - 1.0)
