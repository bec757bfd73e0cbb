"""Level trim and linear modes by JSBSim's own accelerations."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from ftcc.sim.trim import Trim, trim
from tests.support.referee import AIRFRAME, FOOT, NAME, Case, Jsbsim, aircraft_folder, fractions, start_of


def jsbsim_trim(V: float) -> Trim:
    """Level trim by JSBSim's own accelerations: where those of u, w and q vanish."""
    aircraft, scale = Jsbsim(aircraft_folder(), NAME), np.array([0.03, -0.2, 20.0])

    def accelerations(unknown: NDArray[np.float64]) -> list[float]:
        alpha, elevator, thrust = (unknown * scale).tolist()
        _, level = start_of(Case("", V=V))
        commands = {"aileron": 0.0, "elevator": elevator, "rudder": 0.0, "thrust": thrust}
        aircraft.start(level._replace(alpha=alpha), fractions(commands))
        return [aircraft.fdm[f"accelerations/{name}"] for name in ("udot-ft_sec2", "wdot-ft_sec2", "qdot-rad_sec2")]

    found = root(accelerations, np.ones(3), tol=1e-12)
    return Trim(*(found.x * scale).tolist())


MOTION = ("u", "v", "w", "p", "q", "r", "phi", "theta")


def jsbsim_matrix(V: float, step: float = 1e-4) -> NDArray[np.float64]:
    """Derivatives (8, 8) of JSBSim's accelerations and attitude rates by `MOTION` (ft/s, rad/s, rad) in level trim."""
    aircraft, steady = Jsbsim(aircraft_folder(), NAME), trim(AIRFRAME, V)
    fdm = aircraft.fdm
    _, level = start_of(Case("", V=V))
    commands = {"aileron": 0.0, "elevator": steady.elevator, "rudder": 0.0, "thrust": steady.thrust}
    aircraft.start(level, fractions(commands))
    keys = ("u-fps", "v-fps", "w-fps", "p-rad_sec", "q-rad_sec", "r-rad_sec", "phi-rad", "theta-rad")
    at = [V * math.cos(steady.alpha) / FOOT, 0.0, V * math.sin(steady.alpha) / FOOT, 0.0, 0.0, 0.0, 0.0, steady.alpha]
    rates = (
        *(f"accelerations/{one}dot-ft_sec2" for one in "uvw"),
        *(f"accelerations/{one}dot-rad_sec2" for one in "pqr"),
        "velocities/phidot-rad_sec", "velocities/thetadot-rad_sec",
    )  # fmt: skip

    def moved(index: int, by: float) -> NDArray[np.float64]:
        state = dict(zip(keys, at, strict=True))
        state[keys[index]] += by
        # Angles first: JSBSim keeps the velocity over the ground when they change.
        for key in (*keys[6:], *keys[:6]):
            fdm[f"ic/{key}"] = state[key]
        fdm.run_ic()
        return np.array([fdm[rate] for rate in rates])

    columns = [(moved(n, step) - moved(n, -step)) / (2.0 * step) for n in range(len(MOTION))]
    return np.column_stack(columns)
