"""Aircraft of JSBSim in flight: one model per vehicle, flown a step at a time at the call of compiled code."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.callbacks import NOBODY, register
from ftcc.sim.jsbsim.aircraft import Aircraft, load, package, parts_of
from ftcc.sim.jsbsim.bench import TURBULENCE, prepare, set_commands, start_engines
from ftcc.sim.jsbsim.controls import Controls
from ftcc.sim.jsbsim.units import FOOT
from ftcc.sim.plant import LOST

if TYPE_CHECKING:
    import jsbsim

__all__ = ["Driven", "FlownAircraft", "ModelState", "Modelled", "lost_text", "preload", "start_models", "trouble_of"]

_EARTH_RADIUS, _FLATTENING = 6_378_137.0, 1.0 / 298.257223563
"""WGS 84."""


_READ = (
    "position/lat-geod-rad", "position/long-gc-rad", "position/h-sl-ft",
    "velocities/v-north-fps", "velocities/v-east-fps", "velocities/v-down-fps",
    "attitude/phi-rad", "attitude/theta-rad", "attitude/psi-rad",
    "velocities/p-rad_sec", "velocities/q-rad_sec", "velocities/r-rad_sec",
)  # fmt: skip
"""What JSBSim says of an aircraft's motion."""
_WIND = ("atmosphere/wind-north-fps", "atmosphere/wind-east-fps", "atmosphere/wind-down-fps")


class Driven(NamedTuple):
    """Columns of ``Fleet.driven``: what our side gives a model for a step."""

    aileron: float
    """rad, as all deflections of ours: positive turns about its axis negatively."""
    elevator: float
    rudder: float
    thrust: float
    """N."""
    wind_north: float
    """m/s."""
    wind_east: float
    wind_up: float


class ModelState(NamedTuple):
    """The first entries of a plant's ``State`` that flies a model: what the model says of its motion."""

    x: float
    """North of home, m."""
    y: float
    """East of home, m."""
    z: float
    """Up, m."""
    vx: float
    """Over the ground, north, m/s."""
    vy: float
    vz: float
    q0: float
    """Attitude, body to north-east-down."""
    q1: float
    q2: float
    q3: float
    p: float
    """Body rates, rad/s."""
    q: float
    r: float


@dataclass(frozen=True)
class FlownAircraft:
    """A vehicle's aircraft of JSBSim; part of its `VehicleSpec`."""

    aircraft: Aircraft
    controls: Controls
    home: tuple[float, float, float]
    """Latitude and longitude (deg) and altitude (m) of the origin of the local frame."""
    altitude: float
    """Above mean sea level, at which its controls were measured and level flight is sought, m."""
    step_us: int
    """Step of our plant, us."""
    seed: int
    """Of what JSBSim draws at random, such as its own turbulence."""


class Modelled:
    """A model in flight."""

    def __init__(self, flown: FlownAircraft, uav: int) -> None:
        self.name = flown.aircraft.title
        self.controls = flown.controls
        self.parts = parts_of(flown.step_us)
        self.model = load(flown.aircraft, flown.step_us)
        self.trouble = ""
        """Why the model failed; "" while it has not."""
        latitude, self.longitude, self.altitude = (
            math.radians(flown.home[0]),
            math.radians(flown.home[1]),
            flown.home[2],
        )
        self.latitude = latitude
        eccentricity = _FLATTENING * (2.0 - _FLATTENING)
        bent = 1.0 - eccentricity * math.sin(latitude) ** 2
        self.north = _EARTH_RADIUS * (1.0 - eccentricity) / bent**1.5 + self.altitude
        """Metres per radian of latitude at home."""
        self.east = (_EARTH_RADIUS / math.sqrt(bent) + self.altitude) * math.cos(self.latitude)
        """Metres per radian of longitude at home."""
        prepare(self.model, flown.aircraft)
        self.turbulence = dict(flown.aircraft.properties).get(TURBULENCE, 0.0)
        self.model["simulation/randomseed"] = (flown.seed * 1000 + uav) % 2**31
        self._read = [self._node(name).get_double_value for name in _READ]
        self._blow = [self._node(name).set_double_value for name in _WIND]

    def _node(self, name: str) -> jsbsim.FGPropertyNode:
        """A property by itself: faster than by its name in each step."""
        node = self.model.get_property_manager().get_node(name, True)
        assert node is not None
        return node

    def begin(self, state: NDArray[np.float64], driven: NDArray[np.float64]) -> None:
        """Start in ``state``, which begins with a `ModelState`, with engines steady under ``driven``, see `Driven`.

        The motion as the model says it then replaces the one given.
        """
        s, model = ModelState(*state[: len(ModelState._fields)].tolist()), self.model
        phi, theta, psi = _euler(s.q0, s.q1, s.q2, s.q3)
        model["ic/lat-geod-deg"] = math.degrees(self.latitude + s.x / self.north)
        model["ic/long-gc-deg"] = math.degrees(self.longitude + s.y / self.east)
        model["ic/h-sl-ft"] = (s.z + self.altitude) / FOOT
        model["ic/phi-rad"], model["ic/theta-rad"], model["ic/psi-true-rad"] = phi, theta, psi
        model["ic/vn-fps"], model["ic/ve-fps"], model["ic/vd-fps"] = s.vx / FOOT, s.vy / FOOT, -s.vz / FOOT
        model["ic/p-rad_sec"], model["ic/q-rad_sec"], model["ic/r-rad_sec"] = s.p, s.q, s.r
        at_start = Driven(*driven.tolist())
        set_commands(
            model,
            self.controls.commands(at_start.aileron, at_start.elevator, at_start.rudder, at_start.thrust),
        )
        model.run_ic()
        start_engines(model)
        model[TURBULENCE] = self.turbulence
        state[: len(ModelState._fields)] = self.motion()

    def step(self, driven: NDArray[np.float64], state: NDArray[np.float64]) -> None:
        """Fly one step of ours under ``driven`` (7,), see `Driven`; the motion becomes the first entries of ``state``.

        If the model fails, they become nan, and `trouble` tells why.
        """
        aileron, elevator, rudder, thrust, north, east, up = driven.tolist()
        try:
            set_commands(self.model, self.controls.commands(aileron, elevator, rudder, thrust))
            blow = self._blow
            blow[0](north / FOOT)
            blow[1](east / FOOT)
            blow[2](-up / FOOT)
            for _ in range(self.parts):
                self.model.run()
            state[: len(ModelState._fields)] = self.motion()
        except Exception as error:  # JSBSim's errors have no common class; the caller is compiled code
            self.trouble = " ".join(str(error).split()) or type(error).__name__
            state[: len(ModelState._fields)] = math.nan

    def motion(self) -> ModelState:
        """Return the motion as the model says it."""
        latitude, longitude, height, north, east, down, phi, theta, psi, p, q, r = [read() for read in self._read]
        return ModelState(
            (latitude - self.latitude) * self.north,
            (longitude - self.longitude) * self.east,
            height * FOOT - self.altitude,
            north * FOOT,
            east * FOOT,
            -down * FOOT,
            *_quaternion(phi, theta, psi),
            p,
            q,
            r,
        )


_flown: dict[int, list[Modelled | None]] = {}
"""The models of each fleet, by the address of the function that flies them."""


def start_models(
    flown: Sequence[FlownAircraft | None],
    uavs: Sequence[int],
    state: NDArray[np.float64],
    driven: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Load and start the models of a fleet; return the address (1,) of the function that flies one for a step.

    It takes the number of a vehicle; models live as long as the array.

    Parameters
    ----------
    flown : sequence of FlownAircraft or None
        By vehicle.
    uavs : sequence of int
        Ids.
    state : array
        (k, n): the states of the fleet, which begin with a `ModelState`.
    driven : array
        (k, 7): what drives them at the start, and later in each step, see `Driven`.
    """
    if not any(flown):
        return np.full(1, NOBODY, np.int64)
    models = [None if one is None else Modelled(one, uav) for one, uav in zip(flown, uavs, strict=True)]
    for i, model in enumerate(models):
        if model is not None:
            model.begin(state[i], driven[i])

    def fly(i: int) -> None:
        model = models[i]
        assert model is not None
        model.step(driven[i], state[i])

    address = register(fly)
    _flown[int(address[0])] = models
    weakref.finalize(address, _flown.pop, int(address[0]), None)
    return address


def trouble_of(address: NDArray[np.int64], i: int) -> str:
    """Return why the model of vehicle ``i`` of a fleet failed; "" if it did not, or the vehicle has none."""
    models = _flown.get(int(address[0]))
    model = models[i] if models else None
    return model.trouble if model is not None else ""


def lost_text(address: NDArray[np.int64], i: int, why: int) -> str:
    """Say why vehicle ``i`` of a fleet was lost, a key of ``plant.LOST``, with what its model has to say."""
    trouble = trouble_of(address, i)
    return f"{LOST[why]}: {trouble}" if trouble else LOST[why]


def preload() -> None:
    """Load JSBSim, before processes are forked."""
    package()


def _euler(q0: float, q1: float, q2: float, q3: float) -> tuple[float, float, float]:
    """Roll, pitch and heading of an attitude, rad."""
    return (
        math.atan2(2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2)),
        math.asin(min(max(2.0 * (q0 * q2 - q3 * q1), -1.0), 1.0)),
        math.atan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3)),
    )


def _quaternion(phi: float, theta: float, psi: float) -> tuple[float, float, float, float]:
    """The attitude of roll, pitch and heading (rad)."""
    cr, sr = math.cos(0.5 * phi), math.sin(0.5 * phi)
    cp, sp = math.cos(0.5 * theta), math.sin(0.5 * theta)
    cy, sy = math.cos(0.5 * psi), math.sin(0.5 * psi)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
