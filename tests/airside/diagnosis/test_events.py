"""Events of changed beliefs: which changes are announced, when, and in which words."""

from __future__ import annotations

from typing import Any

import pytest

from ftcc.airside.autopilots import build
from ftcc.airside.diagnosis.beliefs import (
    BIAS,
    FAULTY,
    FLOATING,
    HEALTHY,
    LOSS,
    NO_KIND,
    SLOW,
    STUCK,
    SUSPECTED,
    UNDETERMINED,
    WRONG,
    Belief,
)
from ftcc.airside.diagnosis.events import belief_text, note_beliefs
from ftcc.airside.diagnosis.gains import diagnosis_gains
from ftcc.airside.leader import drain_leader_events
from ftcc.airside.spec import DiagnosisSpec
from ftcc.link.actuators import ELEVATOR, THRUST
from tests.support.swarm import autopilot, timing

BELIEF = Belief(FAULTY, LOSS, 0.421, 0.048, 0.104, 0.02, 0.0, 9.88, 10.0, 10.3)
NOTICED = "elevator: something is wrong, not known yet what (noticed 0.12 s after it began)"


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"kind": LOSS}, "elevator faulty: loss, effectiveness 0.42 +- 0.05"),
        ({"kind": BIAS}, "elevator faulty: bias 0.10 +- 0.02 rad"),
        ({"kind": WRONG}, "elevator faulty: loss and bias, effectiveness 0.42 +- 0.05, bias 0.10 +- 0.02 rad"),
        ({"kind": FLOATING}, "elevator faulty: floating"),
        ({"kind": STUCK}, "elevator faulty: stuck"),
        ({"kind": SLOW}, "elevator faulty: slow"),
        ({"state": UNDETERMINED, "kind": NO_KIND}, NOTICED),
    ],
)
def test_what_is_believed_in_words(changes: dict[str, float], text: str) -> None:
    assert belief_text("elevator", HEALTHY, BELIEF._replace(**changes)) == ("warning", text)


def test_the_point_masses_actuators_have_their_names_and_units() -> None:
    belief = BELIEF._replace(kind=BIAS)
    assert belief_text("load_factor", HEALTHY, belief)[1] == "load factor faulty: bias 0.10 +- 0.02"
    assert belief_text("thrust", HEALTHY, belief)[1] == "thrust faulty: bias 0.10 +- 0.02 N"


def test_each_change_is_announced_once_with_the_numbers_of_its_instant() -> None:
    """A suspicion is none; a leader's row and other actuators are left alone."""
    on = DiagnosisSpec(on=True, gains=tuple(diagnosis_gains({})), actuators=("thrust", "elevator"))
    specs = [autopilot(uav, diagnosis=on) for uav in (1, 2)]
    autopilots, _ = build(specs, timing("flight", 1.0))

    def believe(at_us: int, slot: int, **changes: Any) -> None:
        autopilots.diagnosis.belief[1, slot] = BELIEF._replace(**changes)
        note_beliefs(autopilots, 1, at_us)

    believe(0, ELEVATOR, state=HEALTHY, kind=NO_KIND)
    believe(10_000, ELEVATOR, state=SUSPECTED, kind=NO_KIND)
    believe(20_000, ELEVATOR, state=UNDETERMINED, kind=NO_KIND)
    believe(30_000, ELEVATOR)
    believe(40_000, ELEVATOR, effectiveness=0.5)
    believe(50_000, THRUST, kind=BIAS, bias=-3.0)
    believe(60_000, ELEVATOR, state=UNDETERMINED, kind=NO_KIND)
    believe(70_000, ELEVATOR, kind=STUCK)
    believe(80_000, ELEVATOR, state=HEALTHY, kind=NO_KIND)
    assert drain_leader_events(autopilots, specs) == [
        (20_000, 2, "warning", NOTICED),
        (30_000, 2, "warning", "elevator faulty: loss, effectiveness 0.42 +- 0.05"),
        (50_000, 2, "warning", "thrust faulty: bias -3.00 +- 0.02 N"),
        (60_000, 2, "warning", "elevator: its fault has changed, not known yet how"),
        (70_000, 2, "warning", "elevator faulty: stuck"),
        (80_000, 2, "info", "elevator healthy again"),
    ]
    assert drain_leader_events(autopilots, specs) == []
