"""The notebook in docs: its cells run in order, and show what they say."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).parents[3] / "docs" / "study.ipynb"


def run_cell(source: str, names: dict[str, Any]) -> Any:
    """Run a cell; return the value of its last line if that is an expression, as a notebook shows it."""
    body = ast.parse(source).body
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), str(NOTEBOOK), "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), names)


def test_cells_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    document = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    assert all(not cell.get("outputs") for cell in document["cells"]), "the notebook is kept without outputs"
    names: dict[str, Any] = {}
    shown = [run_cell("".join(cell["source"]), names) for cell in document["cells"] if cell["cell_type"] == "code"]
    assert "<table>" in shown[0]._repr_html_()
    assert len(names["effectiveness"]) == len(names["peak"]) == 48
    assert names["on"].of + names["off"].of == 48
    assert "<svg" in shown[3]._repr_html_()
    assert names["page"].read_text(encoding="utf-8").count("<svg") >= 3
