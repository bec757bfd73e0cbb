"""An aircraft held still in the air, as on a test bench: what accelerates it in a state, under given commands."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from ftcc.sim.jsbsim.aircraft import Aircraft, JsbsimError, load
from ftcc.sim.jsbsim.units import FOOT, POUND

if TYPE_CHECKING:
    import jsbsim

__all__ = [
    "THROTTLE",
    "TURBULENCE",
    "Accelerations",
    "Bench",
    "Commands",
    "Pose",
    "prepare",
    "set_commands",
    "start_engines",
    "throttles_of",
]

TURBULENCE = "atmosphere/turb-type"
THROTTLE = "fcs/throttle-cmd-norm"
_SURFACES = ("fcs/aileron-cmd-norm", "fcs/elevator-cmd-norm", "fcs/rudder-cmd-norm")


_SETTLING = 4
"""Evaluations in which accelerations agree with the forces that depend on them, such as those by a rate of alpha."""


class Pose(NamedTuple):
    """Motion through still air; all angles in rad, rates in rad/s."""

    V: float
    """m/s."""
    altitude: float
    """Above mean sea level, m."""
    alpha: float = 0.0
    beta: float = 0.0
    bank: float = 0.0
    """Euler's phi."""
    gamma: float = 0.0
    p: float = 0.0
    q: float = 0.0
    r: float = 0.0


class Commands(NamedTuple):
    """Commands to JSBSim's flight controls: surfaces -1..1, throttle 0..1."""

    aileron: float = 0.0
    elevator: float = 0.0
    rudder: float = 0.0
    throttle: float = 0.0


class Accelerations(NamedTuple):
    """Of the body axes."""

    u_dot: float
    """m/s^2."""
    v_dot: float
    w_dot: float
    p_dot: float
    """rad/s^2."""
    q_dot: float
    r_dot: float


def engines_of(model: jsbsim.FGFDMExec) -> int:
    """Return how many engines an aircraft has."""
    return int(model.get_propulsion().get_num_engines())


def throttles_of(model: jsbsim.FGFDMExec) -> list[str]:
    """Return the properties of an aircraft's throttles: one per engine, or one that drives an external force."""
    engines = engines_of(model)
    alone = [THROTTLE] if model.get_property_manager().hasNode(THROTTLE) else []
    return [f"{THROTTLE}[{n}]" for n in range(engines)] if engines else alone


def set_commands(model: jsbsim.FGFDMExec, commands: Commands) -> None:
    """Put commands into force."""
    for name, value in zip(_SURFACES, commands, strict=False):
        model[name] = value
    for throttle in throttles_of(model):
        model[throttle] = commands.throttle


def prepare(model: jsbsim.FGFDMExec, aircraft: Aircraft) -> None:
    """Make an aircraft clean, engines rich and at full pitch, wheels up; then set its properties, in still air.

    JSBSim's own turbulence, if it is among the properties, is nan while an aircraft is held.
    """
    for n in range(engines_of(model)):
        model[f"fcs/mixture-cmd-norm[{n}]"] = 1.0
        model[f"fcs/advance-cmd-norm[{n}]"] = 1.0
    for name in ("gear/gear-cmd-norm", "gear/gear-pos-norm"):
        if model.get_property_manager().hasNode(name):
            model[name] = 0.0
    for name, value in aircraft.properties:
        model[name] = value
    model[TURBULENCE] = 0.0


def start_engines(model: jsbsim.FGFDMExec) -> None:
    """Let engines run, and come to the steady state of their throttle, while the aircraft is held."""
    if engines_of(model):
        model.get_propulsion().init_running(-1)
    model.set_trim_status(True)  # actuators and filters follow at once
    model.suspend_integration()
    model.run()
    if engines_of(model):
        model.get_propulsion().get_steady_state()
    for _ in range(_SETTLING):
        model.run()
    model.set_trim_status(False)
    model.resume_integration()


class Bench:
    """An aircraft on the bench; each measurement takes a fresh one, as engines remember how warm they were."""

    def __init__(self, aircraft: Aircraft) -> None:
        self.aircraft = aircraft
        self.model = load(aircraft)
        prepare(self.model, aircraft)

    def set(self, pose: Pose, commands: Commands) -> None:
        """Put the aircraft into a state, with its engines steady.

        Raises
        ------
        JsbsimError
            If JSBSim fails there.
        """
        model = self.model
        ca, sa, cb, sb = math.cos(pose.alpha), math.sin(pose.alpha), math.cos(pose.beta), math.sin(pose.beta)
        u, v, w = pose.V * ca * cb, pose.V * sb, pose.V * sa * cb
        # Pitch from path and wind angles: sin(gamma) V = u sin(theta) - (v sin(phi) + w cos(phi)) cos(theta).
        across = v * math.sin(pose.bank) + w * math.cos(pose.bank)
        climb = pose.V * math.sin(pose.gamma) / math.hypot(u, across)
        model["ic/lat-geod-deg"], model["ic/long-gc-deg"] = 0.0, 0.0
        model["ic/h-sl-ft"] = pose.altitude / FOOT
        model["ic/vw-mag-fps"] = 0.0  # JSBSim otherwise takes rounding, and more, for wind
        model["ic/phi-rad"], model["ic/psi-true-rad"] = pose.bank, 0.0
        model["ic/theta-rad"] = math.asin(min(max(climb, -1.0), 1.0)) + math.atan2(across, u)
        model["ic/u-fps"], model["ic/v-fps"], model["ic/w-fps"] = u / FOOT, v / FOOT, w / FOOT
        model["ic/p-rad_sec"], model["ic/q-rad_sec"], model["ic/r-rad_sec"] = pose.p, pose.q, pose.r
        set_commands(model, commands)
        try:
            model.run_ic()
            start_engines(model)
        except Exception as error:  # JSBSim's errors have no common class
            raise JsbsimError(f"{self.aircraft.name}: {' '.join(str(error).split())}") from error

    def accelerations(self) -> Accelerations:
        """Return what accelerates it in the state set."""
        model = self.model
        return Accelerations(
            *(float(model[f"accelerations/{axis}dot-ft_sec2"]) * FOOT for axis in "uvw"),
            *(float(model[f"accelerations/{axis}dot-rad_sec2"]) for axis in "pqr"),
        )

    def thrust(self) -> float:
        """Return the force of engines, or of what stands for one, along the body x axis, N."""
        return sum(self.read(f"forces/fbx-{part}-lbs") or 0.0 for part in ("prop", "external")) * POUND

    def read(self, name: str) -> float | None:
        """Return a property; None if the aircraft has none of that name."""
        return float(self.model[name]) if self.model.get_property_manager().hasNode(name) else None
