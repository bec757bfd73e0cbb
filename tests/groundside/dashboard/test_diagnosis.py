"""What UAVs believe: lanes of states, estimates with their bands, marks, the table; nothing of it without diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ftcc.airside.diagnosis.beliefs import FAULTY, HEALTHY, LOSS, NO_KIND, SUSPECTED, UNDETERMINED
from ftcc.groundside.dashboard import Dashboard, Snapshot
from ftcc.groundside.dashboard.labels import HEALTH, LEFT, describe_beliefs, health_of
from ftcc.groundside.palette import HEALTH_COLORS
from tests.groundside.dashboard.recorded import at, rows
from tests.groundside.dashboard.synthetic_swarm import FAULT_AT, FOLLOWERS, LEADERS, SUBJECT, flight, snapshot

ACTUATORS = ("thrust", "elevator")
DIAGNOSED = replace(SUBJECT, diagnosed=ACTUATORS)
DETECTED, ISOLATED = FAULT_AT + 0.3, FAULT_AT + 1.0
LEFT_AT = FAULT_AT + 3.0
MARK_STRIPS, MARK_COLORS = "LineStrips3D:strips", "LineStrips3D:colors"


def believing(snap: Snapshot) -> Snapshot:
    """The snapshot with what followers believe: UAV 1 detects and isolates its fault, and leaves the swarm."""
    return replace(
        snap,
        uavs={
            uav: replace(state, signals=state.signals | _beliefs(uav, snap.t)) if uav in FOLLOWERS else state
            for uav, state in snap.uavs.items()
        },
    )


def _beliefs(uav: int, t: float) -> Mapping[str, float]:
    state, kind = HEALTHY, NO_KIND
    if uav == 1 and t > DETECTED - 1e-6:
        state, kind = (FAULTY, LOSS) if t > ISOLATED - 1e-6 else (UNDETERMINED, NO_KIND)
    return {
        "health_thrust": HEALTHY, "kind_thrust": NO_KIND, "effectiveness_hat_thrust": 1.0,
        "effectiveness_sd_thrust": 0.05, "bias_hat_thrust": 0.0, "bias_sd_thrust": 1.0, "evidence_thrust": 0.0,
        "health_elevator": state, "kind_elevator": kind, "effectiveness_hat_elevator": 0.75 if state else 1.0,
        "effectiveness_sd_elevator": 0.04, "bias_hat_elevator": 0.3 if state else 0.0, "bias_sd_elevator": 0.02,
        "evidence_elevator": 0.0, "health": state, "worst_effectiveness": 1.0, "climb_left": 5.0,
        "belongs": 0.0 if uav == 1 and t > LEFT_AT - 1e-6 else 1.0,
    }  # fmt: skip


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "diagnosed.rrd"
    dashboard = Dashboard(DIAGNOSED, recording=path, viewer="none")
    for snap in flight(FAULT_AT + 5.0):
        dashboard.log(believing(snap))
    dashboard.close()
    return path


def states(path: Path, lane: str) -> list[tuple[float, str]]:
    times, values = rows(path, lane, "StateChange:state")
    return [(round(float(t), 3), value[0]) for t, value in zip(times, values, strict=True)]


def test_lanes_change_at_onset_detection_and_isolation_and_at_no_other_time(recorded: Path) -> None:
    assert states(recorded, "/believed/UAV_1/truth") == [(0.0, "healthy"), (FAULT_AT, "elevator")]
    changes = [(0.0, "healthy"), (DETECTED, "undetermined"), (ISOLATED, "loss")]
    assert states(recorded, "/believed/UAV_1/elevator") == changes
    assert states(recorded, "/believed/UAV_1/thrust") == [(0.0, "healthy")]
    changes = [(0.0, "healthy"), (DETECTED, "undetermined"), (ISOLATED, "faulty"), (LEFT_AT, "left")]
    assert states(recorded, "/health/UAV_1") == changes
    assert states(recorded, "/health/UAV_2") == [(0.0, "healthy")]
    assert states(recorded, "/health/UAV_7") == []


def test_estimates_beside_the_truth_with_a_band_of_two_sigma(recorded: Path) -> None:
    path = "/plots/diagnosis/1/elevator"
    t = ISOLATED + 1.0
    assert at(recorded, f"{path}/effectiveness", "Measurements:values", t) == [0.75, 0.7]
    assert at(recorded, f"{path}/effectiveness", "Measurements:variances", t) == pytest.approx([0.08**2, 0.0])
    assert at(recorded, f"{path}/bias", "Measurements:values", t) == [0.3, 0.35]
    assert at(recorded, f"{path}/bias", "Measurements:variances", t) == pytest.approx([0.04**2, 0.0])


def test_estimates_of_healthy_actuators_are_sent_seldom(recorded: Path) -> None:
    values = "Measurements:values"
    faulty = rows(recorded, "/plots/diagnosis/1/elevator/effectiveness", values)[0]
    healthy = rows(recorded, "/plots/diagnosis/2/elevator/effectiveness", values)[0]
    assert np.diff(faulty[faulty >= FAULT_AT]).max() == pytest.approx(0.1)
    assert np.diff(healthy[healthy > 0.05]).min() == pytest.approx(0.5)


def test_marks_have_the_shape_and_colour_of_each_state(recorded: Path) -> None:
    shapes = []
    for t, color in ((10.0, 0), (DETECTED, UNDETERMINED), (ISOLATED, FAULTY), (LEFT_AT, LEFT)):
        strips = at(recorded, "/world/health", MARK_STRIPS, t)
        rgba = at(recorded, "/world/health", MARK_COLORS, t)
        assert len(strips) == len(rgba) == len(FOLLOWERS)
        assert tuple(np.uint32(rgba[0]) >> shift & 0xFF for shift in (24, 16, 8)) == HEALTH_COLORS[color]
        place = np.array(at(recorded, "/world/uav/1", "Transform3D:translation", t)[0])
        mark = np.array(strips[0])
        assert mark[:, 0].mean() == pytest.approx(place[0], abs=3.0)
        assert mark[:, 2].max() < place[2]
        shapes.append(len(mark))
    assert shapes == [13, 5, 5, 5]


def test_the_table_says_what_a_uav_believes(recorded: Path) -> None:
    table = at(recorded, "/swarm", "TextDocument:text", LEFT_AT + 1.0)[0]
    assert "| believes |" in table.splitlines()[0]
    assert "left the swarm; elevator loss 75 % +0.3" in table
    assert table.count("| healthy | healthy |") == len(FOLLOWERS) - 1


def test_words_for_beliefs() -> None:
    state = snapshot(1.0).uavs[1]
    assert health_of(state) is None
    assert describe_beliefs(state, ACTUATORS) == ""
    suspecting = replace(state, signals=state.signals | _beliefs(1, 1.0) | {"health_thrust": SUSPECTED, "health": 1.0})
    assert HEALTH[health_of(suspecting) or 0] == "suspected"
    assert describe_beliefs(suspecting, ACTUATORS) == "thrust suspected"
    assert health_of(snapshot(1.0).uavs[LEADERS[0]]) is None


def test_attitudes_have_marks_that_are_drawn_when_they_change(tmp_path: Path) -> None:
    dashboard = Dashboard(replace(DIAGNOSED, family="attitude"), recording=tmp_path / "a.rrd", viewer="none")
    for t in (1.0, 2.0, DETECTED, DETECTED + 0.1):
        dashboard.log(believing(snapshot(t)))
    dashboard.close()
    times, _ = rows(tmp_path / "a.rrd", "/attitudes/health", MARK_STRIPS)
    assert times.tolist() == pytest.approx([1.0, DETECTED])


def test_without_diagnosis_nothing_of_it_is_drawn(recording: Path) -> None:
    assert rows(recording, "/world/health", MARK_STRIPS)[1] == []
    assert rows(recording, "/health/UAV_1", "StateChange:state")[1] == []
    assert rows(recording, "/plots/diagnosis/1/elevator/bias", "Measurements:values")[1] == []
    assert "believes" not in at(recording, "/swarm", "TextDocument:text", 10.0)[0]
