"""One tick of the vehicles of a process, compiled: what lies between two datagrams."""

from __future__ import annotations

from ftcc.link.actuators import encode_command
from ftcc.link.compiled import compiled
from ftcc.sim.plant import actuate, advance, truth
from ftcc.sim.sensors import encode_state, measure

__all__ = ["fly_period", "report_state"]


@compiled
def report_state(fleet, alive, tick, now_us, seed, true, seen, messages, controls):
    """Truth (k, 13), state messages (k, 13) and command in force (k, 4, fractions) of the living at this tick."""
    for i in range(alive.shape[0]):
        if alive[i] == 1:
            actuate(fleet, i, now_us / 1e6)
            truth(fleet, i, now_us / 1e6, true[i])
            measure(fleet, i, tick, seed, true[i], seen)
            encode_state(seen, messages[i])
            encode_command(fleet.command[i], fleet.travel[i], controls[i])


@compiled
def fly_period(fleet, alive, now_us, period_us, step_us, why):
    """Fly the living for one period; ``why`` (k,) is set to a key of ``plant.LOST``."""
    for i in range(alive.shape[0]):
        if alive[i] == 1:
            why[i] = advance(fleet, i, now_us, period_us, step_us)
