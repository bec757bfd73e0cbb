"""Steady flight of an aircraft of JSBSim."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.sim.jsbsim.aircraft import Aircraft
from ftcc.sim.jsbsim.bench import Bench, Commands, Pose
from ftcc.sim.jsbsim.controls import Controls
from ftcc.sim.trim import TrimError

__all__ = ["Steady", "steady_flight"]

_ENOUGH = 1e-6
"""Largest acceleration of steady flight, m/s^2 and rad/s^2."""
_LARGEST_ANGLE = 0.8
"""rad."""


class Steady(NamedTuple):
    """Straight flight at constant speed without sideslip. Propellers may need a bank and all surfaces."""

    alpha: float
    """rad."""
    mu: float
    """Bank about the velocity, rad."""
    elevator: float
    """rad."""
    thrust: float
    """N; what the engines give there."""
    aileron: float
    rudder: float


@functools.cache
def steady_flight(aircraft: Aircraft, controls: Controls, V: float, altitude: float) -> Steady:
    """Return level flight at ``V`` (m/s) and ``altitude`` (m) in still air.

    Raises
    ------
    TrimError
        If there is none within the travel of the controls.
    JsbsimError
        If JSBSim fails there.
    """
    from scipy.optimize import root  # takes longer to import than all else here

    bench = Bench(aircraft)
    surfaces = [name for name in ("elevator", "thrust", "aileron", "rudder") if name not in controls.missing]
    free = ["alpha", *surfaces, *(["bank"] if "aileron" in surfaces or "rudder" in surfaces else [])]
    balance = ["w_dot", *(_BALANCES[name] for name in surfaces), *(["v_dot"] if "bank" in free else [])]
    scale = np.array([_scale(name, controls) for name in free])

    def accelerate(unknown: NDArray[np.float64]) -> list[float]:
        given = dict(zip(free, (unknown * scale).tolist(), strict=True))
        bench.set(
            Pose(V, altitude, alpha=given["alpha"], bank=given.get("bank", 0.0)),
            Commands(
                aileron=controls.aileron.command(given.get("aileron", 0.0)),
                elevator=controls.elevator.command(given.get("elevator", 0.0)),
                rudder=controls.rudder.command(given.get("rudder", 0.0)),
                throttle=controls.thrust.command(given.get("thrust", 0.0)),
            ),
        )
        found = bench.accelerations()._asdict()
        return [found[name] for name in balance]

    begin = np.array([_first_guess(name, controls) for name in free]) / scale
    found = root(accelerate, begin, tol=1e-12)
    values = dict(zip(free, (found.x * scale).tolist(), strict=True))
    beyond = [
        name
        for name in surfaces
        if not getattr(controls, name).least - 1e-9 <= values[name] <= getattr(controls, name).most + 1e-9
    ]
    steady = max(map(abs, accelerate(found.x))) <= _ENOUGH and abs(values["alpha"]) <= _LARGEST_ANGLE
    if beyond or not steady:
        why = f": {', '.join(beyond)} would be beyond its travel" if beyond else ""
        raise TrimError(f"{aircraft.title} has no level flight at {V:g} m/s and {altitude:g} m{why}")
    return Steady(
        alpha=values["alpha"],
        mu=values.get("bank", 0.0),
        elevator=values.get("elevator", 0.0),
        thrust=values.get("thrust", 0.0),
        aileron=values.get("aileron", 0.0),
        rudder=values.get("rudder", 0.0),
    )


_BALANCES = {"elevator": "q_dot", "thrust": "u_dot", "aileron": "p_dot", "rudder": "r_dot"}
"""Which acceleration an actuator brings to zero."""


def _scale(name: str, controls: Controls) -> float:
    """Return a typical value of an unknown."""
    if name in ("alpha", "bank"):
        return 0.05
    control = getattr(controls, name)
    return float(max(abs(control.least), abs(control.most)))


def _first_guess(name: str, controls: Controls) -> float:
    if name == "thrust":
        return float(0.5 * (controls.thrust.least + controls.thrust.most))
    return 0.03 if name == "alpha" else 0.0
