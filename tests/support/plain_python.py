"""The first seconds of every shipped scenario in every form, as hashes of all their bits.

``NUMBA_DISABLE_JIT=1 python -m tests.support.plain_python SECONDS`` prints them for plain Python,
``NUMBA_DISABLE_JIT=0`` for compiled code.
"""

from __future__ import annotations

import hashlib
import sys

import numpy as np

from ftcc.groundside import load, resolve
from ftcc.groundside.scenario.loading import forms_and_variants, read, shipped
from ftcc.groundside.simulation import fly_in_memory

_TWINS = {"jsbsim_attitude": "jsbsim_containment", "jsbsim_fire": "jsbsim_containment"}
"""Scenarios whose law and whose aircraft others fly already: not compiled once more for this."""
CASES = [
    (name, form) for name, path in shipped().items() if name not in _TWINS for form in forms_and_variants(read(path))[0]
]


def digest(scenario: str, form: str, seconds: float) -> str:
    """Hash of every bit that a flight records, at every tick."""
    mission = resolve(load(scenario, form=form, duration=seconds))
    mission = resolve(
        load(scenario, form=form, duration=seconds, settings=[f"record_rate={1e6 / mission.timing.period_us}"])
    )
    flight = fly_in_memory(mission)
    assert not flight.lost, flight.lost
    hashed = hashlib.sha256()
    for array in (flight.truth, flight.command, flight.acting, flight.signals):
        hashed.update(np.ascontiguousarray(array).tobytes())
    return hashed.hexdigest()


if __name__ == "__main__":
    for case in CASES:
        print(*case, digest(*case, seconds=float(sys.argv[1])), flush=True)
