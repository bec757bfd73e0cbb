"""The swarm makes room, with health set by hand: what leaders, neighbours and the UAV itself make of it."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from ftcc.airside.autopilots import Autopilots, build
from ftcc.airside.diagnosis.beliefs import FAULTY, HEALTHY, MOST_CLIMB, Health
from ftcc.airside.diagnosis.cooperation import cooperate, hears_virtual_leader, makes_room, refer_apart
from ftcc.airside.diagnosis.cooperation_arrays import Apart, Neighbour
from ftcc.airside.diagnosis.gains import diagnosis_gains
from ftcc.airside.flight_path import Own
from ftcc.airside.leader import advance_leader, drain_leader_events
from ftcc.airside.references.longitudinal import Reference
from ftcc.airside.spec import AutopilotSpec, DiagnosisSpec
from ftcc.airside.spec import Neighbour as InNeighbour
from ftcc.link.flight_modes import HOLD
from ftcc.link.timing import Timing
from tests.support.swarm import GRAPH, autopilot, timing

GAINS = diagnosis_gains({})
DIAGNOSIS = DiagnosisSpec(on=True, cooperates=True, gains=tuple(GAINS), actuators=("thrust", "elevator"))
DT = 0.01
TIMING: Timing = timing("flight", 300.0)
Z, Z_DOT, V = (Reference._fields.index(name) for name in ("z", "z_dot", "V"))
BELONGS = Health._fields.index("belongs")


def spec(uav: int, **changes: Any) -> AutopilotSpec:
    return autopilot(uav, diagnosis=DIAGNOSIS, **changes)


class Lone:
    """One autopilot, whose inbox a test fills, from tick to tick."""

    def __init__(self, of: AutopilotSpec) -> None:
        self.spec = of
        self.autopilots: Autopilots
        self.autopilots, self.inbox = build([of], TIMING)
        self.n = 0
        self.shares = int(self.autopilots.diagnosis.shares[0])
        self.fly_at(1000.0)

    def fly_at(self, z: float, speed: float = 30.0, gamma: float = 0.0) -> None:
        """The aircraft is there."""
        self.autopilots.own[0] = Own(**dict.fromkeys(Own._fields, 0.0) | {"z": z, "V": speed, "gamma": gamma})

    def hear(self, sender: int, values: tuple[float, ...] = (1000.0, 0.0), **health: float) -> None:
        """A record of this instant."""
        edge = self.spec.edge_from(sender)
        healthy = {"state": HEALTHY, "effectiveness": 1.0, "climb_left": MOST_CLIMB, "belongs": 1.0}
        self.inbox.values[0, edge, : len(values)] = values
        self.inbox.values[0, edge, self.shares :] = Health(**healthy | health)
        self.inbox.stamp[0, edge] = self.now_us
        self.inbox.valid[0, edge] = 1.0

    @property
    def now_us(self) -> int:
        return self.n * TIMING.period_us

    def tick(self, refer: Any = None) -> None:
        """Age the inbox, cooperate, and call a stage behind it."""
        for edge in np.flatnonzero(self.inbox.stamp[0] >= 0):
            self.inbox.age[0, edge] = (self.now_us - self.inbox.stamp[0, edge]) / 1e6
        cooperate(self.autopilots, self.inbox, 0, self.now_us, DT)
        if refer:
            refer(self.autopilots, self.inbox, 0, self.now_us, TIMING.period_us)
        self.n += 1

    def neighbour(self, sender: int) -> Neighbour:
        return Neighbour(*self.autopilots.cooperation.neighbours[0, self.spec.edge_from(sender)].tolist())

    def weight(self, sender: int) -> float:
        return float(self.autopilots.weight[0, self.spec.edge_from(sender)])

    @property
    def belongs(self) -> bool:
        return bool(self.autopilots.diagnosis.health[0, BELONGS])

    def set_health(self, **changes: float) -> None:
        health = Health(*self.autopilots.diagnosis.health[0].tolist())
        self.autopilots.diagnosis.health[0] = health._replace(**changes)

    def events(self) -> list[str]:
        return [text for _, _, _, text in drain_leader_events(self.autopilots, [self.spec])]


def leader() -> Lone:
    """Leader 7 of the reference swarm, which hears all followers without a weight."""
    own = tuple(InNeighbour(j, GRAPH.weights[7, j]) for j in GRAPH.senders(7))
    return Lone(spec(7, neighbours=(*own, *(InNeighbour(j, 0.0) for j in GRAPH.followers))))


def advance(autopilots: Autopilots, inbox: Any, i: int, now_us: int, period_us: int) -> None:
    """As the stage `refer` does."""
    advance_leader(autopilots, inbox, i, now_us, period_us, makes_room(autopilots, i))


def climb_of(flown: Lone, seconds: float, **health: float) -> np.ndarray:
    """Climb rate of a leader at each tick; a follower tells its health all the time, or nobody does."""
    rates = []
    for _ in range(round(seconds / DT)):
        if health:
            flown.hear(3, **health)
        flown.tick(advance)
        rates.append(flown.autopilots.reference[0, Z_DOT])
    return np.array(rates)


def test_health_is_known_while_a_record_is_fresh_and_unknown_is_not_healthy():
    flown = Lone(spec(1))
    flown.tick()
    assert flown.neighbour(2).known == 0.0
    flown.hear(2, state=FAULTY, climb_left=1.5)
    flown.tick()
    assert flown.neighbour(2) == (1.0, FAULTY, 1.0, 1.5, 1.0)
    flown.n += round(GAINS.fresh / DT)
    flown.tick()
    assert flown.neighbour(2) == (0.0, FAULTY, 1.0, 1.5, 1.0)


def test_what_is_known_before_take_off_is_no_word_of_having_left():
    """Some schemes brief UAVs of their neighbours' motion; such a record holds no health."""
    briefed = tuple(dataclasses.replace(n, briefing=(1000.0, 0.0)) for n in spec(1).neighbours)
    flown = Lone(spec(1, neighbours=briefed))
    for _ in range(round(2.0 * GAINS.fading / DT)):
        flown.tick()
    assert flown.weight(2) == GRAPH.weights[1, 2]


def test_a_leader_climbs_as_the_weakest_follower_can_without_a_jump_and_again_as_before():
    flown = leader()
    before = climb_of(flown, 35.0)
    assert before[-1] > 1.8
    held = climb_of(flown, 12.0, climb_left=0.5)
    assert held[-1] == pytest.approx(GAINS.room * 0.5, rel=1e-12)
    after = climb_of(flown, 60.0, climb_left=MOST_CLIMB)
    assert after.max() > 1.1
    steps = np.abs(np.diff(np.concatenate((before, held, after)))) / DT
    own = 0.05**2 * 100.0
    """Largest acceleration of the profile itself, m/s^2."""
    assert steps.max() <= max(GAINS.room_pace, own) * (1.0 + 1e-9)
    assert flown.events() == [
        "leader makes room: it climbs and sinks no faster than UAV 3 can",
        "leader makes room for nobody any more",
    ]
    assert math.isinf(flown.autopilots.cooperation.apart[0, Apart._fields.index("limit")])


def test_the_cosine_of_a_leader_is_limited_as_well():
    """(5.54): its amplitude of 60 m at 0.02 rad/s sinks with up to 1.2 m/s."""
    flown = leader()
    free = climb_of(flown, 240.0)
    assert free.min() < -1.1
    flown = leader()
    climb_of(flown, 149.0)
    held = climb_of(flown, 91.0, climb_left=0.5)
    assert held.min() >= -0.5 * GAINS.room - 1e-12
    assert np.abs(np.diff(held)).max() / DT <= GAINS.room_pace + 1e-9


def test_a_silent_follower_is_neither_healthy_nor_waited_for_for_ever():
    flown = leader()
    climb_of(flown, 30.0)
    climb_of(flown, 10.0, climb_left=0.5)
    quiet = climb_of(flown, GAINS.silent - 1.0)
    assert quiet == pytest.approx(GAINS.room * 0.5, rel=1e-12)
    assert climb_of(flown, 10.0).max() > 0.9


def test_nobody_waits_for_one_that_has_left():
    flown = leader()
    climb_of(flown, 30.0)
    assert climb_of(flown, 5.0, climb_left=0.0, belongs=0.0).min() > 1.5


def test_one_that_has_left_fades_out_of_the_sums_and_in_again():
    flown = Lone(spec(1))
    flown.hear(2)
    flown.tick()
    assert flown.weight(2) == GRAPH.weights[1, 2]
    weights = []
    for belongs, slower in ((0.0, 1.5), (1.0, 15.0)):
        for _ in range(round(slower * GAINS.fading / DT)):
            flown.hear(2, belongs=belongs)
            flown.tick()
            weights.append(flown.weight(2))
    assert min(weights) == 0.0
    assert weights[-1] == GRAPH.weights[1, 2]
    assert np.abs(np.diff(weights)).max() == pytest.approx(GRAPH.weights[1, 2] * DT / GAINS.fading)
    assert flown.weight(6) == GRAPH.weights[1, 6]


def leave(flown: Lone, z: float) -> None:
    """UAV 1, whose own estimate is at 1000 m, can climb no more and is at ``z``."""
    flown.fly_at(z, 27.0)
    flown.autopilots.shared[0, :2] = 1000.0, 0.0
    flown.set_health(state=FAULTY, effectiveness=0.4, climb_left=0.0)
    for _ in range(round(GAINS.leaving / DT) + 1):
        assert flown.belongs
        flown.tick()
    flown.tick()
    assert not flown.belongs


def test_one_that_cannot_climb_leaves_says_so_and_flies_level_where_it_is():
    flown = Lone(spec(1))
    leave(flown, 990.0)
    assert flown.events() == ["leaves the swarm: it cannot keep up"]
    assert hears_virtual_leader(flown.autopilots, 0)
    records, motion = flown.autopilots.cooperation.records, []
    for _ in range(3000):
        flown.tick(refer_apart)
        assert not flown.belongs
        motion.append(records[0, 0, :2].copy())
    z, z_dot = np.array(motion).T
    assert z[0] == pytest.approx(1000.0, abs=1e-9), "it begins where the law's own estimate is"
    assert z[-1] == pytest.approx(990.0, abs=0.01)
    assert np.diff(z) / DT == pytest.approx(z_dot[:-1], abs=1e-9)
    assert np.abs(z_dot).max() <= 3.0
    assert np.abs(np.diff(z_dot)).max() / DT <= 0.6
    # It was slow; the beliefs of its actuators leave it the mission's speed.
    assert flown.autopilots.reference[0, V] == pytest.approx(30.0, abs=0.05)


def test_one_that_is_healthy_but_far_from_its_place_stays():
    """Another one may be the cause."""
    flown = Lone(spec(1))
    for state, stays in ((HEALTHY, True), (FAULTY, False)):
        flown.fly_at(1000.0 - 2.0 * GAINS.astray)
        flown.set_health(state=state)
        for _ in range(round(2.0 * GAINS.leaving / DT)):
            for sender in GRAPH.senders(1):
                flown.hear(sender)
            flown.tick()
        assert flown.belongs is stays


def test_one_that_is_on_its_way_to_its_place_stays():
    """Who comes back moves the places of others by a hundred metres at once."""
    flown = Lone(spec(1))
    flown.set_health(state=FAULTY)
    for n in range(2000):
        flown.fly_at(900.0 + 2.0 * n * DT, gamma=math.asin(2.0 / 30.0))
        for sender in GRAPH.senders(1):
            flown.hear(sender)
        flown.tick()
    assert flown.belongs


def test_after_a_repair_it_flies_to_its_place_and_belongs_again():
    flown = Lone(spec(1))
    leave(flown, 990.0)
    flown.set_health(state=HEALTHY, effectiveness=1.0, climb_left=MOST_CLIMB)
    places = (1012.0, 1010.0, 1006.0)
    back = 0.0
    for _ in range(6000):
        for sender, z in zip(GRAPH.senders(1), places, strict=True):
            flown.hear(sender, (z, 0.2))
        flown.tick(refer_apart)
        if flown.belongs:
            back = flown.n * DT
            break
    mean = np.average(places, weights=[GRAPH.weights[1, j] for j in GRAPH.senders(1)])
    assert back > GAINS.leaving + GAINS.returning
    assert flown.belongs
    assert not hears_virtual_leader(flown.autopilots, 0)
    assert flown.autopilots.cooperation.lone[0, Z] == pytest.approx(mean, abs=1.0)
    assert flown.autopilots.reference[0, V] == 30.0, "the mission's"
    assert flown.events()[-1] == "is back in the swarm"


def test_the_ground_may_hold_one_that_is_apart():
    flown = Lone(spec(1))
    leave(flown, 990.0)
    flown.autopilots.mode[0] = HOLD
    flown.tick()
    assert not hears_virtual_leader(flown.autopilots, 0)
    assert not flown.belongs
