"""The flow of simulated time: all processes are held before the same tick."""

from __future__ import annotations

import math
from typing import Any

import pytest

from ftcc.groundside.swarm.flow import Flow, FlowError
from ftcc.link.gate import Limit, Pace


class Swarm:
    """Vehicle processes that stop where their limit says, each a little ahead of the last."""

    def __init__(self, *ticks: int, lockstep: bool = False, held: bool = False) -> None:
        self.ticks = {f"vehicle {n}": tick for n, tick in enumerate(ticks)}
        self.sent: list[Any] = []
        self.flow = Flow(0.01, 1.0, lockstep, held, self.sent.append, lambda: list(self.ticks))

    def obey(self) -> None:
        """Fly as far as the limits allow and report, until no more messages are sent."""
        while limits := [message for message in self.sent if isinstance(message, Limit)]:
            self.sent.clear()
            limit = limits[-1].tick
            assert limit is not None
            for name in self.ticks:
                self.ticks[name] = max(self.ticks[name], limit + 1)
                self.flow.mark_held(name, self.ticks[name])


def test_a_pause_brings_all_processes_to_the_latest_tick():
    swarm = Swarm(100, 103, 101)
    swarm.flow.pause()
    swarm.obey()
    assert (swarm.flow.state, swarm.flow.tick) == ("held", 103)
    assert set(swarm.ticks.values()) == {103}


def test_a_step_is_exactly_as_long_as_asked():
    swarm = Swarm(100, 103, lockstep=True)
    swarm.flow.pause()
    swarm.obey()
    swarm.flow.step(5)
    swarm.obey()
    assert (swarm.flow.state, swarm.flow.tick) == ("held", 108)


def test_a_swarm_started_held_can_be_stepped_from_the_first_tick_on():
    swarm = Swarm(0, 0, held=True)
    pace, limit = swarm.flow.begin()
    assert (pace.tick, limit.tick) == (0, -1)
    swarm.flow.step(1)
    swarm.obey()
    assert swarm.flow.tick == 1


def test_resume_goes_on_from_the_tick_at_which_it_was_held():
    swarm = Swarm(100, 103)
    swarm.flow.pause()
    swarm.obey()
    swarm.flow.resume()
    pace, limit = swarm.sent
    assert (pace.tick, limit) == (103, Limit(None))
    assert swarm.flow.state == "flying"


@pytest.mark.parametrize("what", [lambda flow: flow.step(1), lambda flow: flow.resume()])
def test_what_is_not_held_can_be_neither_stepped_nor_resumed(what):
    with pytest.raises(FlowError, match="pause it before"):
        what(Swarm(5).flow)


def test_another_speed_begins_at_a_tick_that_is_the_same_for_all_and_not_past():
    swarm = Swarm(0)
    pace, _ = swarm.flow.begin()
    swarm.flow.set_speed(4.0)
    (new,) = swarm.sent
    assert isinstance(new, Pace)
    assert new.speed == 4.0
    assert new.wall == pytest.approx(pace.wall + (new.tick - pace.tick) * 0.01)


def test_in_lockstep_another_speed_begins_wherever_each_process_is():
    """The current tick of a swarm on a slow computer is unknown."""
    swarm = Swarm(0, lockstep=True)
    swarm.flow.begin()
    for speed in (4.0, math.inf, 0.5):
        swarm.sent.clear()
        swarm.flow.set_speed(speed)
        (pace,) = swarm.sent
        assert (pace.tick, pace.speed) == (None, speed)


def test_the_wall_clock_cannot_run_as_fast_as_possible():
    with pytest.raises(FlowError, match="lockstep"):
        Swarm(0).flow.set_speed(math.inf)
