"""A leader's profile: altitude and speed commands through second-order filters, by time or by position.

Eqs. (5.54)-(5.55), the climbs over obstacles of chapter 6 and the like. The filters are propagated exactly from tick to
tick for the command in force. Commands by position wait for a leader (this one, or one that this one hears) to
pass a forward position; they come in a fixed order, and a fired one supersedes every command by time.
"""

from __future__ import annotations

from ftcc.airside.references.profiles.arrays import (
    ALTITUDE,
    CLAMPED,
    CLIMB_LIMIT,
    FIRED,
    FROM_GROUND,
    PROFILE_PARAMETERS,
    PROFILE_STATES,
    SINK_LIMIT,
    SPEED,
    TRIGGER_COLUMNS,
    new_profile_state,
    profile_arrays,
    trigger_rows,
)
from ftcc.airside.references.profiles.data import Command, Cosine, Profile, SpeedWave, Trigger
from ftcc.airside.references.profiles.ground_commands import command_from_ground, release_from_ground
from ftcc.airside.references.profiles.motion import armed, refer, stand
from ftcc.airside.references.profiles.sampling import climb_of_step, climb_range, largest_acceleration, sampled

__all__ = [
    "ALTITUDE",
    "CLAMPED",
    "CLIMB_LIMIT",
    "FIRED",
    "FROM_GROUND",
    "PROFILE_PARAMETERS",
    "PROFILE_STATES",
    "SINK_LIMIT",
    "SPEED",
    "TRIGGER_COLUMNS",
    "Command",
    "Cosine",
    "Profile",
    "SpeedWave",
    "Trigger",
    "armed",
    "climb_of_step",
    "climb_range",
    "command_from_ground",
    "largest_acceleration",
    "new_profile_state",
    "profile_arrays",
    "refer",
    "release_from_ground",
    "sampled",
    "stand",
    "trigger_rows",
]
