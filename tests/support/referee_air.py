"""Turbulence of JSBSim and ours, as series at an aircraft that stands still in its field."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.jsbsim import write_aircraft
from ftcc.groundside.scenario.wind import low_altitude, turning_air
from ftcc.link.compiled import compiled
from ftcc.sim.build import build_fleet
from ftcc.sim.fleet import Fleet
from ftcc.sim.plants import cycle_of
from ftcc.sim.plants.attitude import State
from ftcc.sim.turning_air import NOT_TURNING, TurningAir, rotation
from ftcc.sim.wind import Turbulence, blow, moving_air
from tests.support import referee
from tests.support.referee import AIRFRAME, FOOT
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


def _in_the_field(
    kind: int,
    dt: float,
    integrator: int,
    altitude: float,
    wind: float,
    seed: int,
    towards: float = 0.0,
    folder: Path | None = None,
) -> Any:
    """JSBSim with our aircraft in level flight at `SPEED`, and its turbulence on."""
    aircraft = referee.Jsbsim(folder or referee.aircraft_folder(), referee.NAME, dt, integrator)
    steady, state = referee.start_of(referee.Case("", V=SPEED))
    commands = {"aileron": 0.0, "elevator": steady.elevator, "rudder": 0.0, "thrust": steady.thrust}
    aircraft.start(state._replace(z=altitude), referee.fractions(commands))
    settings = {
        "randomseed": seed,
        # The mean wind says in which direction the field lies; a breath is enough.
        "wind-north-fps": 1e-9 * math.cos(towards),
        "wind-east-fps": 1e-9 * math.sin(towards),
        "turbulence/milspec/windspeed_at_20ft_AGL-fps": wind / FOOT,
        "turbulence/milspec/severity": 3.0,
        "turb-type": kind,
    }
    for name, value in settings.items():
        aircraft.fdm[f"atmosphere/{name}"] = value
    return aircraft.fdm


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
    fdm = _in_the_field(kind, dt, NO_INTEGRATOR, altitude, wind, 1, towards)
    names = [f"atmosphere/turb-{one}-fps" for one in ("north", "east", "down")]
    names += [f"atmosphere/{one}-turb-rad_sec" for one in "pqr"]
    tree = fdm.get_property_manager()
    nodes = [tree.get_node(name) for name in names]
    rows = np.empty((steps, len(nodes)))
    for k in range(steps):
        fdm.run()
        rows[k] = [node.get_double_value() for node in nodes]
    return Air(rows[:, :3] * [FOOT, FOOT, -FOOT], rows[:, 3:])


def write_for_air_that_does_not_turn(folder: Path) -> None:
    """Write the aircraft so that its damping follows its own rates, and not those against the air."""
    (file, *_) = write_aircraft(referee.SHEET, referee.NAME, folder, actuators=referee.STILL)
    text = file.read_text(encoding="utf-8")
    file.write_text(re.sub(r"velocities/([pqr])-aero-rad_sec", r"velocities/\1-rad_sec", text), encoding="utf-8")


def rates_of_jsbsim(
    kind: int, seed: int, seconds: float, *, altitude: float, wind: float, folder: Path | None = None
) -> NDArray[np.float64]:
    """Body rates p, q, r (n, 3), rad/s, every 10 ms, of JSBSim's aircraft with fixed controls in its turbulence."""
    fdm = _in_the_field(kind, referee.DT, referee.ADAMS_BASHFORTH_4, altitude, wind, seed, folder=folder)
    rows = []
    for k in range(1, round(seconds / referee.DT) + 1):
        fdm.run()
        if k % 10 == 0:
            rows.append([fdm[f"velocities/{one}-rad_sec"] for one in "pqr"])
    return np.array(rows)


def our_turning(deviation: Triple, length: Triple) -> TurningAir:
    """How our air turns for our aircraft, as the specification has it."""
    return turning_air(deviation[2], length[2], AIRFRAME.b, SPEED)


def jsbsims_turning(deviation: Triple, length: Triple) -> TurningAir:
    """The same with JSBSim's p_g, that of MIL-STD-1797A: sigma = 1.9 sigma_w / sqrt(L_w b), scale sqrt(L_w b) / 2.6."""
    root = math.sqrt(length[2] * AIRFRAME.b)
    ours = our_turning(deviation, length)
    return ours._replace(
        deviation=1.9 * deviation[2] / root, bandwidth=(2.6 * SPEED / root, ours.bandwidth[1], ours.bandwidth[2])
    )


def reverse_pitch(fleet: Fleet) -> None:
    """Give q_g the sign that it has in JSBSim: nose up where the air *sinks* faster ahead."""
    fleet.turning[:, 1, 0] *= -1.0


def our_rates(
    seed: int,
    seconds: float,
    *,
    altitude: float,
    wind: float,
    turning: Callable[[Triple, Triple], TurningAir] | None = None,
    reversed_pitch: bool = False,
) -> NDArray[np.float64]:
    """The same of our aircraft in our turbulence, whose air turns as ``turning`` says; None: it does not."""
    deviation, length = low_altitude(wind, altitude)
    along, right, up = (SPEED / one for one in length)
    rotating = NOT_TURNING if turning is None else turning(deviation, length)
    steady, level = referee.start_of(referee.Case("", V=SPEED))
    spec = vehicle(
        plant="attitude",
        initial=level._replace(z=altitude),
        command=(0.0, steady.elevator, 0.0, steady.thrust),
        limits=tuple((one.lowest, one.highest) for one in referee.STILL.values()),
        turbulence=Turbulence(deviation, (along, right, up), 1000, seed, rotating),
    )
    fleet, cycle = build_fleet([spec]), cycle_of("attitude")
    if reversed_pitch:
        reverse_pitch(fleet)
    rows = []
    for k in range(round(100 * seconds)):
        assert cycle.advance(fleet, 0, 10_000 * k, 10_000, 1000) == 0
        state = State(*fleet.state[0].tolist())
        rows.append([state.p, state.q, state.r])
    return np.array(rows)


@compiled
def _blown(fleet, first, out, turning):
    for k in range(out.shape[0]):
        blow(fleet, 0, first + k + 1)
        for component in range(3):
            out[k, component] = moving_air(fleet, 0, component, 0.0)
        rotation(fleet, 0, turning[k])


def our_air(steps: int, dt: float, deviation: Triple, length: Triple) -> Air:
    """Our turbulence for standard deviations (m/s) and scale lengths (m): along, right, up."""
    along, right, up = (SPEED / one for one in length)
    turbulence = Turbulence(deviation, (along, right, up), round(dt * 1e6), 1, our_turning(deviation, length))
    level = referee.start_of(referee.Case("", V=SPEED))[1]
    fleet: Fleet = build_fleet([vehicle(plant="attitude", initial=level, turbulence=turbulence)])
    speed, turned = np.empty((steps, 3)), np.empty((steps, 3))
    _blown(fleet, 0, speed, turned)
    return Air(speed, turned)


def dryden_spectra(omega: NDArray[np.float64], deviation: Triple, length: Triple) -> NDArray[np.float64]:
    """One-sided spectra (3, n) of MIL-F-8785C, 3.7.1.2, in (m/s)^2 per Hz, along, right, up, at ``omega`` (rad/s)."""
    rows = []
    for n, (sigma, scale) in enumerate(zip(deviation, length, strict=True)):
        x = scale * omega / SPEED
        shape = 2.0 / (1.0 + x * x) if n == 0 else (1.0 + 3.0 * x * x) / (1.0 + x * x) ** 2
        # The specification's are per rad/m: sigma^2 scale / pi times this; per Hz it is 2 pi / V times that.
        rows.append(2.0 * sigma * sigma * scale / SPEED * shape)
    return np.array(rows)


def turning_spectra(omega: NDArray[np.float64], deviation: Triple, length: Triple) -> NDArray[np.float64]:
    """One-sided spectra (3, n) of p_g, q_g, r_g of MIL-F-8785C, 3.7.5, in (rad/s)^2 per Hz, at ``omega`` (rad/s)."""
    _, right, up = dryden_spectra(omega, deviation, length)
    W, b = omega / SPEED, AIRFRAME.b
    wide, long = 1.0 + (4.0 * b * W / math.pi) ** 2, 1.0 + (3.0 * b * W / math.pi) ** 2
    rolling = deviation[2] ** 2 / length[2] * 0.8 * (math.pi * length[2] / (4.0 * b)) ** (1.0 / 3.0) / wide
    return np.array([2.0 * math.pi / SPEED * rolling, W * W / wide * up, W * W / long * right])
