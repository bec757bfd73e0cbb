"""Where the time of one flight in memory goes: the share of each part of its ticks, of its memory, of its judgement.

The very functions of the simulation are called in their order, stage by stage for all UAVs; between stages compiled
code reads the clock. The flight and what comes before and after it are measured in the same run, in turn.
"""

from __future__ import annotations

import functools
import statistics
import time
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from ftcc.groundside import load
from ftcc.groundside.claims import evaluate
from ftcc.groundside.scenario import Mission, resolve
from ftcc.groundside.simulation import fly_in_memory
from ftcc.groundside.simulation.flight_arrays import new_world
from ftcc.groundside.simulation.one_process import loop_of
from ftcc.link.system_calls import monotonic
from ftcc.sim.plants import conditions_of

__all__ = ["STAGES", "flight_shares", "stage_seconds"]

STAGES = (
    "vehicle: command into force",
    "vehicle: sense",
    "autopilot: decode state",
    "channel: hear",
    "reference",
    "law",
    "channel: publish",
    "recording",
    "vehicle: fly on",
)
_IN_ONE_PIECE = "the same in one piece"


@functools.cache
def _flyer(scheme: str, plant: str) -> Any:
    """A compiled function that flies all ticks of a world and adds the time of each stage to its last argument."""
    loop = loop_of(scheme, plant)
    set_links, record, fly_on = loop.set_links, loop._record, loop._advance_vehicles
    force, measure, sense = loop._apply_last_command, loop._state_of, loop._sense
    hear, refer, control, publish = loop._hear, loop._refer, loop._control_follower, loop._publish

    @numba.njit
    def fly(world, timing, ticks, room, spent):
        fleet, pilots, inbox, events, exchange = (
            world.fleet, world.autopilots, world.inbox, world.events, world.exchange,
        )  # fmt: skip
        lost = world.recording.lost
        k = lost.shape[0]
        states, controls = np.zeros((k, world.state.shape[0])), np.zeros((k, world.controls.shape[0]))
        for n in range(ticks):
            now = n * timing.period_us
            clock = monotonic(room)
            set_links(events, inbox, now)
            for stage in range(9):
                if stage == 7:
                    record(world, timing, n)
                if stage == 8:
                    fly_on(world, timing, n)
                for i in range(k):
                    if lost[i] > 0:
                        continue
                    if stage == 0 and n > 0:
                        force(world, i)
                    elif stage == 1:
                        measure(fleet, i, n, now, timing.seed, world.true[i], world.measured, states[i], controls[i])
                    elif stage == 2:
                        sense(pilots, i, states[i], controls[i], now)
                    elif stage == 3:
                        hear(world.attacks, exchange, inbox, events, timing, i, now)
                    elif stage == 4:
                        refer(pilots, inbox, i, now, timing.period_us)
                    elif stage == 5:
                        control(world, timing, i, now)
                    elif stage == 6 and now % timing.exchange_us == 0:
                        publish(pilots, world.attacks, exchange, events, i, now // timing.exchange_us, now)
                after = monotonic(room)
                spent[stage] += after - clock
                clock = after

    return fly


def _new_world(mission: Mission) -> Any:
    return new_world(mission.vehicles, mission.autopilots, mission.timing, len(conditions_of(mission.plant)))


def stage_seconds(mission: Mission) -> tuple[dict[str, float], Any]:
    """Fly a mission whose messages travel by wire, stage by stage: wall time of each stage, s; and the world after it.

    The recording is the same as that of `fly_in_memory`, bit for bit.
    """
    assert mission.wire
    fly, room = _flyer(mission.scheme.name, mission.plant), np.zeros(2, np.int64)
    fly(_new_world(mission), mission.timing, 1, room, np.zeros(len(STAGES)))
    found: dict[str, float] = {}
    world, spent = _timed(found, "empty recording", lambda: _new_world(mission)), np.zeros(len(STAGES))
    fly(world, mission.timing, mission.timing.ticks + 1, room, spent)
    return found | dict(zip(STAGES, spent.tolist(), strict=True)), world


def flight_shares(
    repeats: int, name: str = "containment", variants: tuple[str, ...] = ("loss30",)
) -> list[dict[str, Any]]:
    """Rows of a table: the parts of a whole flight of a study, in s and as shares of their sum; medians.

    The last two rows show that sum, and the same flight in one piece: stages that are compiled together are a little
    faster, but Python calls them some hundred times.
    """
    fly_in_memory(resolve(load(name, variants=list(variants))))
    measured = [_parts(name, list(variants)) for _ in range(repeats)]
    found = {what: statistics.median(one[what] for one in measured) for what in measured[0]}
    whole = sum(seconds for what, seconds in found.items() if what != _IN_ONE_PIECE)
    rows: list[dict[str, Any]] = [
        {"part": what, "s": seconds, "share": f"{seconds / whole:.1%}"}
        for what, seconds in found.items()
        if what != _IN_ONE_PIECE
    ]
    around = sum(found[what] for what in ("load and check", "claims", "verdict"))
    rows.append({"part": "sum", "s": whole, "share": "100.0%"})
    rows.append({"part": _IN_ONE_PIECE, "s": found[_IN_ONE_PIECE] + around})
    return rows


def _parts(name: str, variants: list[str]) -> dict[str, float]:
    """Wall time of each part of a flight, s, and of `fly_in_memory`."""
    before: dict[str, float] = {}
    after: dict[str, float] = {}
    mission = _timed(before, "load and check", lambda: resolve(load(name, variants=variants)))
    flight = _timed(after, _IN_ONE_PIECE, lambda: fly_in_memory(mission))
    _timed(after, "claims", lambda: evaluate(flight, mission.claims, mission.case, mission.graph))
    _timed(after, "verdict", lambda: flight.verdict)
    return before | stage_seconds(mission)[0] | after


def _timed(into: dict[str, float], name: str, action: Callable[[], Any]) -> Any:
    begun = time.perf_counter()
    result = action()
    into[name] = time.perf_counter() - begun
    return result
