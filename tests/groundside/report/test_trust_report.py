"""The section on trust: who distrusted whom, how much and since when."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside.report.plates import Plates
from ftcc.groundside.report.trust import trust_sections
from ftcc.groundside.scenario.loading import load
from ftcc.groundside.scenario.mission import Mission, resolve


@pytest.fixture(scope="module")
def mission() -> Mission:
    return resolve(load("containment", form="flight", settings={"defence": {"jump": 1.0}}))


def links(trust: dict[tuple[int, int], list[float]]) -> dict[str, np.ndarray]:
    """Reports at 0 s, 1 s, ... on the edges (receiver, sender)."""
    rows = [(float(t), *edge, value) for edge, values in trust.items() for t, value in enumerate(values)]
    columns = np.array(rows).T
    return dict(zip(("t", "uav", "sender", "trust"), columns, strict=True))


def test_every_edge_that_was_doubted_has_a_row_the_worst_first(mission: Mission, tmp_path: Path) -> None:
    told = links({(1, 2): [1.0, 0.9, 1.0, 1.0], (1, 6): [1.0, 0.4, 0.1, 0.1], (3, 2): [1.0, 1.0, 1.0, 1.0]})
    (section,) = trust_sections(told, mission, Plates(tmp_path))
    texts = [[cell.text for cell in row] for row in section.rows]
    assert texts == [["UAV 1", "UAV 6", "0.10", "0.40", "75", "1"], ["UAV 1", "UAV 2", "0.90", "0.97", "0", ""]]
    assert "<svg" in section.svg


def test_nobody_doubted_is_said(mission: Mission, tmp_path: Path) -> None:
    (section,) = trust_sections(links({(1, 2): [1.0, 1.0]}), mission, Plates(tmp_path))
    assert section.before[-1] == "Nobody was doubted."
    assert not section.rows


def test_without_defences_or_in_an_older_run_there_is_no_section(mission: Mission, tmp_path: Path) -> None:
    told = links({(1, 2): [1.0, 0.1]})
    undefended = resolve(load("containment", form="flight"))
    assert trust_sections(told, undefended, Plates(tmp_path)) == []
    del told["trust"]
    assert trust_sections(told, mission, Plates(tmp_path)) == []
