"""Turbulence of JSBSim and ours, as series at an aircraft that stands still in its field."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled
from ftcc.sim.build import build_fleet
from ftcc.sim.fleet import Fleet
from ftcc.sim.wind import Turbulence, blow, moving_air
from tests.support import referee
from tests.support.referee import FOOT
from tests.support.swarm import vehicle

MILSPEC, TUSTIN = 3, 4
"""JSBSim's ``turb-type``: the filters of MIL-STD-1797A, and those of MIL-F-8785C by Tustin's rule."""
NO_INTEGRATOR = 0
SPEED = 30.0
"""m/s."""
Triple = tuple[float, float, float]


class Air(NamedTuple):
    """A series of moving air, by step."""

    speed: NDArray[np.float64]
    """(n, 3): north, east, up, m/s."""
    turning: NDArray[np.float64]
    """(n, 3): p, q, r of the air, rad/s."""


def jsbsim_air(
    kind: int,
    steps: int,
    dt: float,
    *,
    altitude: float,
    wind: float,
    towards: float = 0.0,
    seed: int = 1,
    V: float = 30.0,
) -> Air:
    """Turbulence of JSBSim at ``altitude`` (m) in ``wind`` (m/s, at 20 ft), which blows ``towards`` (rad)."""
    aircraft = referee.Jsbsim(referee.aircraft_folder(), referee.NAME, dt, NO_INTEGRATOR)
    steady, state = referee.start_of(referee.Case("", V=SPEED))
    commands = {"aileron": 0.0, "elevator": steady.elevator, "rudder": 0.0, "thrust": steady.thrust}
    aircraft.start(state._replace(z=altitude), referee.fractions(commands))
    settings = {
        "randomseed": 1,
        # The mean wind says in which direction the field lies; a breath is enough.
        "wind-north-fps": 1e-9 * math.cos(towards),
        "wind-east-fps": 1e-9 * math.sin(towards),
        "turbulence/milspec/windspeed_at_20ft_AGL-fps": wind / FOOT,
        "turbulence/milspec/severity": 3.0,
        "turb-type": kind,
    }
    for name, value in settings.items():
        aircraft.fdm[f"atmosphere/{name}"] = value
    names = [f"atmosphere/turb-{one}-fps" for one in ("north", "east", "down")]
    names += [f"atmosphere/{one}-turb-rad_sec" for one in "pqr"]
    tree = aircraft.fdm.get_property_manager()
    nodes = [tree.get_node(name) for name in names]
    rows = np.empty((steps, len(nodes)))
    for k in range(steps):
        aircraft.fdm.run()
        rows[k] = [node.get_double_value() for node in nodes]
    return Air(rows[:, :3] * [FOOT, FOOT, -FOOT], rows[:, 3:])


@compiled
def _blown(fleet, first, out):
    for k in range(out.shape[0]):
        blow(fleet, 0, first + k + 1)
        for component in range(3):
            out[k, component] = moving_air(fleet, 0, component, 0.0)


def our_air(steps: int, dt: float, deviation: Triple, length: Triple) -> NDArray[np.float64]:
    """Our turbulence (steps, 3) along, right, up, m/s, for standard deviations (m/s) and scale lengths (m)."""
    along, right, up = (SPEED / one for one in length)
    turbulence = Turbulence(deviation, (along, right, up), round(dt * 1e6), seed=1)
    level = referee.start_of(referee.Case("", V=SPEED))[1]
    fleet: Fleet = build_fleet([vehicle(plant="attitude", initial=level, turbulence=turbulence)])
    out = np.empty((steps, 3))
    _blown(fleet, 0, out)
    return out


def dryden_spectra(omega: NDArray[np.float64], deviation: Triple, length: Triple) -> NDArray[np.float64]:
    """One-sided spectra (3, n) of MIL-F-8785C, 3.7.1.2, in (m/s)^2 per Hz, along, right, up, at ``omega`` (rad/s)."""
    rows = []
    for n, (sigma, scale) in enumerate(zip(deviation, length, strict=True)):
        x = scale * omega / SPEED
        shape = 2.0 / (1.0 + x * x) if n == 0 else (1.0 + 3.0 * x * x) / (1.0 + x * x) ** 2
        # The specification's are per rad/m: sigma^2 scale / pi times this; per Hz it is 2 pi / V times that.
        rows.append(2.0 * sigma * sigma * scale / SPEED * shape)
    return np.array(rows)
