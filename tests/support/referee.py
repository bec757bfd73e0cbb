"""The referee: the same aircraft under the same controls in our equations of motion and in JSBSim, and how far apart.

Both start at latitude and longitude 0, north is x, east y, up z. JSBSim flies what `write_aircraft` writes.
"""

from __future__ import annotations

import functools
import math
import os
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ftcc.groundside.jsbsim import Actuator, write_aircraft
from ftcc.groundside.schema import AirframeSheet
from ftcc.link.actuators import ACTUATORS
from ftcc.sim.airframe import Airframe
from ftcc.sim.build import build_fleet
from ftcc.sim.disturbances import Disturbance
from ftcc.sim.plants import cycle_of
from ftcc.sim.plants.attitude import DISTURBANCES, State
from ftcc.sim.trim import Trim, trim
from ftcc.sim.wind import DiscreteGust
from tests.support.swarm import AIRFRAME, vehicle

FOOT = 0.3048
DT = 0.001
"""Step of both sides, s."""
ADAMS_BASHFORTH_4 = 5
"""Of JSBSim's integrators: explicit, fourth order, which is what our Runge-Kutta has."""
SAMPLE = 0.1
"""s, between the states that are compared."""
NAME = "referee"
SHEET = AirframeSheet(title="reference airframe", T_max=120.0, **AIRFRAME._asdict())
STILL = {name: Actuator(-0.8, 0.8) for name in ACTUATORS} | {"thrust": Actuator(0.0, SHEET.T_max)}
"""Without lag; 18 m/s needs 36 deg of elevator."""


class Jump(NamedTuple):
    """What changes at once, and stays."""

    time: float
    """s."""
    what: str
    """An actuator (rad or N, added to the trim), or "wind": m/s to the north, everywhere."""
    by: float


class Gust(NamedTuple):
    """A 1-cosine gust upwards that falls as it rose."""

    time: float
    rise: float
    """s."""
    up: float
    """m/s."""


@dataclass(frozen=True)
class Case:
    """A flight from level trim."""

    name: str
    jumps: tuple[Jump, ...] = ()
    gust: Gust | None = None
    V: float = 25.0
    """m/s."""
    chi: float = 0.0
    """rad."""
    seconds: float = 20.0

    def value(self, what: str, t: float, share: float = 0.5) -> float:
        """The sum of the jumps until ``t`` (s), and this share of one that happens right then.

        A multistep method connects its samples: a jump that is whole in one sample acts half a step before it. Half a
        jump in the sample in which it happens puts it back.
        """
        close = 0.25 * DT
        return sum(
            one.by * (1.0 if t > one.time + close else share)
            for one in self.jumps
            if one.what == what and t > one.time - close
        )


def doublet(what: str, size: float, time: float = 1.0, width: float = 1.0) -> tuple[Jump, ...]:
    """To one side, to the other, back."""
    return Jump(time, what, size), Jump(time + width, what, -2.0 * size), Jump(time + 2.0 * width, what, size)


_RAD = math.radians(1.0)
CASES = (
    Case("level flight"),
    Case("elevator step of 1 deg", (Jump(1.0, "elevator", -_RAD),)),
    Case("aileron step of 0.5 deg", (Jump(1.0, "aileron", -0.5 * _RAD),)),
    Case("rudder step of 2 deg", (Jump(1.0, "rudder", -2.0 * _RAD),)),
    Case("thrust step of 20 N", (Jump(1.0, "thrust", 20.0),)),
    Case("elevator doublet of 5 deg", doublet("elevator", 5.0 * _RAD)),
    Case("aileron doublet of 10 deg", doublet("aileron", 10.0 * _RAD)),
    Case("rudder doublet of 10 deg", doublet("rudder", 10.0 * _RAD)),
    Case(
        "all four at once, at 18 m/s",
        (
            *doublet("elevator", 4.0 * _RAD),
            *doublet("aileron", -8.0 * _RAD, 1.5, 0.8),
            *doublet("rudder", 6.0 * _RAD, 2.0, 1.2),
            Jump(1.0, "thrust", 15.0),
        ),
        V=18.0,
    ),
    Case(
        "turn and climb",
        (
            Jump(1.0, "elevator", -3.0 * _RAD),
            *doublet("aileron", 10.0 * _RAD, 1.0, 0.7),
            *doublet("rudder", -10.0 * _RAD, 2.0),
            Jump(1.0, "aileron", -0.4 * _RAD),
            Jump(4.0, "aileron", 0.35 * _RAD),
            Jump(2.0, "thrust", 30.0),
        ),
    ),
    Case(
        "roll of 360 deg, then a steep turn",
        (Jump(1.0, "aileron", -0.7), Jump(4.0, "aileron", 0.7), Jump(1.0, "thrust", 40.0)),
        V=30.0,
    ),
    Case("wind of 5 m/s from the side", (Jump(1.0, "wind", 5.0),), chi=math.radians(60.0)),
    Case("1-cosine gust, 4 m/s upwards", gust=Gust(1.0, 1.0, 4.0)),
)


class Track(NamedTuple):
    """A flight, a row every `SAMPLE` from the start."""

    position: NDArray[np.float64]
    """(n, 3): north, east, up, m."""
    velocity: NDArray[np.float64]
    """(n, 3): over the ground, likewise, m/s."""
    attitude: Rotation
    """(n,): north-east-down from forward-right-down."""
    rates: NDArray[np.float64]
    """(n, 3): p, q, r, rad/s."""


class Apart(NamedTuple):
    """How far two flights are apart, by row."""

    position: NDArray[np.float64]
    """m."""
    attitude: NDArray[np.float64]
    """deg."""
    velocity: NDArray[np.float64]
    """m/s."""
    rates: NDArray[np.float64]
    """deg/s."""


def apart(one: Track, other: Track) -> Apart:
    """The lengths of the differences."""
    return Apart(
        np.linalg.norm(one.position - other.position, axis=1),
        np.degrees((one.attitude.inv() * other.attitude).magnitude()),
        np.linalg.norm(one.velocity - other.velocity, axis=1),
        np.degrees(np.linalg.norm(one.rates - other.rates, axis=1)),
    )


# --- our side --------------------------------------------------------------------------------------------------------


def start_of(case: Case) -> tuple[Trim, State]:
    """Level trim of the reference airframe, and the state in it, at 1000 m."""
    steady = trim(AIRFRAME, case.V)
    return steady, State(0.0, 0.0, 1000.0, case.V, case.chi, 0.0, 0.0, steady.alpha, 0.0, 0.0, 0.0, 0.0)


def fly_ours(
    case: Case, actuators: Mapping[str, Actuator] = STILL, step_us: int = 1000, airframe: Airframe = AIRFRAME
) -> Track:
    """Fly the plant ``attitude`` by the compiled cycle that flies in every scenario."""
    steady, state = start_of(case)
    names = [name for name, _ in DISTURBANCES]
    winds = tuple(Disturbance(j.time, float(names.index("gust")), j.by, 0.0) for j in case.jumps if j.what == "wind")
    command = np.array([0.0, steady.elevator, 0.0, steady.thrust])
    moved = [actuators[name] for name in ACTUATORS]
    gusts = ()
    if case.gust is not None:
        time, rise, up = case.gust
        gusts = (DiscreteGust(time, rise, 0.0, 0.0, up, until=time + rise),)
    spec = vehicle(
        plant="attitude",
        airframe=airframe,
        initial=state,
        command=tuple(command.tolist()),
        limits=tuple((one.lowest, one.highest) for one in moved),
        lag=tuple(one.lag for one in moved),
        rate=tuple(one.rate for one in moved),
        disturbances=winds,
        discrete_gusts=gusts,
    )
    fleet, cycle, period = build_fleet([spec]), cycle_of("attitude"), 10_000
    rows = [fleet.state[0].copy()]
    for k in range(round(case.seconds * 1e6) // period):
        middle = (k + 0.5) * period / 1e6
        fleet.command[0] = command + [case.value(name, middle) for name in ACTUATORS]
        assert cycle.advance(fleet, 0, k * period, period, step_us) == 0, (case.name, middle)
        if (k + 1) * period % round(SAMPLE * 1e6) == 0:
            rows.append(fleet.state[0].copy())
    return track_of([State(*row.tolist()) for row in rows])


def track_of(states: list[State]) -> Track:
    """Of our states."""
    path = Rotation.from_euler("ZYX", [(s.chi, s.gamma, s.mu) for s in states])
    ground = [(s.V * math.cos(s.gamma), s.chi, s.V * math.sin(s.gamma)) for s in states]
    return Track(
        np.array([(s.x, s.y, s.z) for s in states]),
        np.array([(v * math.cos(chi), v * math.sin(chi), up) for v, chi, up in ground]),
        path * Rotation.from_euler("ZY", [(-s.beta, s.alpha) for s in states]),
        np.array([(s.p, s.q, s.r) for s in states]),
    )


# --- JSBSim's side ---------------------------------------------------------------------------------------------------


class Jsbsim:
    """An aircraft in JSBSim, in SI units and our names."""

    def __init__(self, folder: Path, name: str, dt: float = DT, integrator: int | None = ADAMS_BASHFORTH_4) -> None:
        os.environ.setdefault("JSBSIM_DEBUG", "0")  # before the import: without its banners
        import jsbsim

        self.fdm: Any = jsbsim.FGFDMExec(str(folder), None)
        self.fdm.set_aircraft_path(str(folder))
        self.fdm.set_dt(dt)  # before the model: its filters take the step when they are loaded
        if not self.fdm.load_model(name):
            raise ValueError(f"{folder / name}: JSBSim does not load it")
        for of in ("rate", "position") if integrator is not None else ():
            for motion in ("rotational", "translational"):
                self.fdm[f"simulation/integrator/{of}/{motion}"] = integrator

    def start(self, state: State, commands: Mapping[str, float]) -> None:
        """Begin in this state of still air, with commands as fractions of travel."""
        nose = track_of([state]).attitude[0]
        psi, theta, phi = nose.as_euler("ZYX").tolist()
        ca, sa, cb, sb = math.cos(state.alpha), math.sin(state.alpha), math.cos(state.beta), math.sin(state.beta)
        for name, value in commands.items():
            self.fdm[f"fcs/{name}-cmd-norm"] = value
        initial = {
            "lat-geod-deg": 0.0, "long-gc-deg": 0.0, "h-sl-ft": state.z / FOOT,
            "psi-true-rad": psi % (2.0 * math.pi), "theta-rad": theta, "phi-rad": phi,
            "u-fps": state.V * ca * cb / FOOT, "v-fps": state.V * sb / FOOT, "w-fps": state.V * sa * cb / FOOT,
            "p-rad_sec": state.p, "q-rad_sec": state.q, "r-rad_sec": state.r,
        }  # fmt: skip
        for name, value in initial.items():
            self.fdm[f"ic/{name}"] = value
        if not self.fdm.run_ic():
            raise ValueError("JSBSim does not start in this state")

    @property
    def row(self) -> tuple[float, ...]:
        """North, east, up (m); velocity likewise (m/s); psi, theta, phi (rad); p, q, r (rad/s)."""
        at = self.fdm
        return (
            at["position/ecef-z-ft"] * FOOT, at["position/ecef-y-ft"] * FOOT, at["position/h-sl-ft"] * FOOT,
            at["velocities/v-north-fps"] * FOOT, at["velocities/v-east-fps"] * FOOT,
            -at["velocities/v-down-fps"] * FOOT,
            at["attitude/psi-rad"], at["attitude/theta-rad"], at["attitude/phi-rad"],
            at["velocities/p-rad_sec"], at["velocities/q-rad_sec"], at["velocities/r-rad_sec"],
        )  # fmt: skip


@functools.cache
def aircraft_folder(name: str = NAME) -> Path:
    """Where the aircraft of `SHEET` without lag lies, written once for a process."""
    folder = Path(tempfile.mkdtemp(prefix="ftcc-referee-"))
    write_aircraft(SHEET, name, folder, actuators=STILL)
    return folder


def write_in_si(folder: Path) -> None:
    """Write the same aircraft with inertia and thrust by JSBSim's own table of units.

    There 1 slug ft^2 is 1.35594 kg m^2 and 1 N is 0.22482 lb; exactly it is 1.355818 and 0.224809.
    """
    (file, *_) = write_aircraft(SHEET, NAME, folder, actuators=STILL)
    text = file.read_text(encoding="utf-8")
    for key, field in (("ixx", "Ix"), ("iyy", "Iy"), ("izz", "Iz"), ("ixz", "Ixz")):
        text = re.sub(rf'<{key} unit="SLUG\*FT2">[^<]+', f'<{key} unit="KG*M2">{getattr(SHEET, field)}', text)
    text = re.sub(r"<value>0\.2248\d+</value>", "<value>0.22482</value>", text)
    file.write_text(text, encoding="utf-8")


def fractions(commands: Mapping[str, float], actuators: Mapping[str, Actuator] = STILL) -> dict[str, float]:
    """Commands in rad and N as JSBSim's inputs."""
    found = {name: commands[name] / actuators[name].travel for name in ACTUATORS if name != "thrust"}
    return found | {"throttle": commands["thrust"] / SHEET.T_max}


def fly_jsbsim(
    case: Case,
    *,
    folder: Path | None = None,
    actuators: Mapping[str, Actuator] = STILL,
    dt: float = DT,
    integrator: int | None = ADAMS_BASHFORTH_4,
    share: float = 0.5,
) -> Track:
    """Fly the aircraft of ``folder``, by default `aircraft_folder`, in JSBSim; ``share`` as in `Case.value`."""
    steady, state = start_of(case)
    level = {"aileron": 0.0, "elevator": steady.elevator, "rudder": 0.0, "thrust": steady.thrust}
    aircraft = Jsbsim(folder or aircraft_folder(), NAME, dt, integrator)
    aircraft.start(state, fractions(level, actuators))
    fdm, every = aircraft.fdm, round(SAMPLE / dt)
    moving = [name for name in ACTUATORS if any(jump.what == name for jump in case.jumps)]
    wind = any(jump.what == "wind" for jump in case.jumps)
    changes = [jump.time for jump in case.jumps]
    rows = [aircraft.row]
    for k in range(1, round(case.seconds / dt) + 1):
        t = k * dt
        # What is set before frame k acts on the accelerations at its end, t = k dt.
        if any(abs(t - time) < 2.5 * dt for time in changes):
            now = fractions(
                {name: _shared(case, name, level[name], t, share, actuators) for name in ACTUATORS}, actuators
            )
            for name in moving:
                key = "throttle" if name == "thrust" else name
                fdm[f"fcs/{key}-cmd-norm"] = now[key]
            if wind:
                fdm["atmosphere/wind-north-fps"] = case.value("wind", t, share) / FOOT
        if case.gust is not None and k == round(case.gust.time / dt):
            _begin(fdm, case.gust)
        fdm.run()
        if k % every == 0:
            rows.append(aircraft.row)
    found = np.array(rows)
    return Track(found[:, :3], found[:, 3:6], Rotation.from_euler("ZYX", found[:, 6:9]), found[:, 9:])


def _shared(case: Case, name: str, level: float, t: float, share: float, actuators: Mapping[str, Actuator]) -> float:
    """The command around ``t``, within its travel before and after a jump, of which ``share`` counts right then."""
    moved = actuators[name]
    before, after = (min(max(level + case.value(name, t, one), moved.lowest), moved.highest) for one in (0.0, 1.0))
    return before + share * (after - before)


def _begin(fdm: Any, gust: Gust) -> None:
    settings = {
        "startup-duration-sec": gust.rise, "steady-duration-sec": 0.0, "end-duration-sec": gust.rise,
        "magnitude-ft_sec": gust.up / FOOT, "frame": 3.0, "X-velocity-ft_sec": 0.0, "Y-velocity-ft_sec": 0.0,
        "Z-velocity-ft_sec": -1.0, "start": 1.0,
    }  # fmt: skip
    for name, value in settings.items():
        fdm[f"atmosphere/cosine-gust/{name}"] = value
