"""The settings of the defences, by name as those of a scheme; with 0 each of them is off.

What is plausible belongs to aircraft, mission and law: docs/defences.md says how to choose the sizes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

from ftcc.airside import ranges
from ftcc.airside.ranges import Range
from ftcc.airside.scheme import Quantity
from ftcc.airside.settings import settings_with

__all__ = ["DEFENCE_RANGES", "DefenceGains", "defence_gains"]

Q = Quantity


class DefenceGains(NamedTuple):
    """Settings of the stage `defend`. Sizes come in threes: for values in m, in m/s and in rad."""

    F: Annotated[float, Q("F", "-", "extreme values on each side of the own one that are left out; 0: none", 0.0)]
    hull: Annotated[float, Q("F_hull", "-", "lying neighbours whose values are moved into the hull of others'", 0.0)]
    jump: Annotated[float, Q("jump", "m", "change that the told rate does not explain; beyond it: a lie; 0: off", 0.0)]
    jump_speed: Annotated[float, Q("jump_speed", "m/s", "likewise", 0.0)]
    jump_angle: Annotated[float, Q("jump_angle", "rad", "likewise", 0.0)]
    most_speed: Annotated[float, Q("most_speed", "m/s", "largest rate of a value in m; beyond it: a lie; 0: any", 0.0)]
    most_accel: Annotated[float, Q("most_accel", "m/s^2", "largest rate of a value in m/s; 0: any", 0.0)]
    most_turn: Annotated[float, Q("most_turn", "rad/s", "largest rate of a value in rad; 0: any", 0.0)]
    past: Annotated[float, Q("past", "m", "surprise by what the sender's last record predicts; 0: off", 0.0)]
    past_speed: Annotated[float, Q("past_speed", "m/s", "likewise", 0.0)]
    past_angle: Annotated[float, Q("past_angle", "rad", "likewise", 0.0)]
    crowd: Annotated[float, Q("crowd", "m", "surprise by the distance from the neighbours' median; 0: off", 0.0)]
    crowd_speed: Annotated[float, Q("crowd_speed", "m/s", "likewise", 0.0)]
    crowd_angle: Annotated[float, Q("crowd_angle", "rad", "likewise", 0.0)]
    oldest: Annotated[float, Q("oldest", "s", "age from which on a neighbour does not count; 0: never", 0.0)]
    ban: Annotated[float, Q("ban", "s", "time for which a lie takes a neighbour's say", 5.0)]
    recovery: Annotated[float, Q("recovery", "s", "time in which trust that was lost comes back", 20.0)]
    horizon: Annotated[float, Q("horizon", "s", "longest time over which a told rate is believed", 1.0)]
    memory: Annotated[float, Q("memory", "s", "time over which a neighbour's standing is averaged", 2.0)]


_WHOLE = Range(0.0, 100.0, "it is no number of neighbours; 0 is off", whole=True)

DEFENCE_RANGES = {
    _WHOLE: "F hull",
    ranges.LIMIT_OR_OFF: (
        "jump jump_speed jump_angle most_speed most_accel most_turn past past_speed past_angle "
        "crowd crowd_speed crowd_angle"
    ),
    ranges.OPTIONAL_TIME: "oldest",
    ranges.FILTER_TIME: "ban recovery memory",
    ranges.TIME: "horizon",
}


def defence_gains(overrides: Mapping[str, float]) -> DefenceGains:
    """The settings with ``overrides``.

    Raises
    ------
    ValueError
        For a name that there is not, or a value out of its range.
    """
    return settings_with(DefenceGains, DEFENCE_RANGES, overrides, "trusted")  # type: ignore[no-any-return]
