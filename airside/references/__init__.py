"""What is tracked: the leaders' profiles, and a UAV's own reference.

The latter depends on the scheme's ``PLANT``: the module of that name declares the NamedTuple ``Reference`` and the
compiled ``refer(parameters, commands, reference, now_us, period_us)``, which brings a UAV's row of references to the
tick at ``now_us`` and is called once at every tick, and ``stand(reference, period_us)``, which is called in its place
in hold and returns whether the clock of the commands stands still, too.
``parameters`` (n,) and ``commands`` (m, c), rows with their time (s) first, are those of
`ftcc.airside.spec.OwnReference`; a row whose time is inf is unused. A module whose commands may come from the ground
has ``command_from_ground(message, own, now_us)``: the row that a SET_ATTITUDE_TARGET asks for, and why it is refused.
"""

from __future__ import annotations

import importlib
from types import ModuleType

__all__ = ["of_plant"]


def of_plant(plant: str) -> ModuleType:
    """The module of the references that UAVs on a plant have of their own."""
    return importlib.import_module(f"{__name__}.{plant}")
