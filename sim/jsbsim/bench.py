"""An aircraft held still in the air, as on a test bench: what accelerates it in a state, under given commands."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, NamedTuple

from ftcc.sim.jsbsim.aircraft import FOOT, Aircraft, JsbsimError, load

if TYPE_CHECKING:
    import jsbsim

__all__ = [
    "POUND",
    "THROTTLE",
    "Accelerations",
    "Bench",
    "Commands",
    "Pose",
    "bench_of",
    "prepare",
    "set_commands",
    "start_engines",
]

THROTTLE = "fcs/throttle-cmd-norm"
_SURFACES = ("fcs/aileron-cmd-norm", "fcs/elevator-cmd-norm", "fcs/rudder-cmd-norm")
POUND = 4.4482216152605
"""N."""


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


def set_commands(model: jsbsim.FGFDMExec, commands: Commands) -> None:
    """Put commands into force."""
    for name, value in zip(_SURFACES, commands, strict=False):
        model[name] = value
    for n in range(engines_of(model)):
        model[f"{THROTTLE}[{n}]"] = commands.throttle


def prepare(model: jsbsim.FGFDMExec) -> None:
    """Make an aircraft clean: engines rich and at full pitch, wheels up."""
    for n in range(engines_of(model)):
        model[f"fcs/mixture-cmd-norm[{n}]"] = 1.0
        model[f"fcs/advance-cmd-norm[{n}]"] = 1.0
    for name in ("gear/gear-cmd-norm", "gear/gear-pos-norm"):
        if model.get_property_manager().hasNode(name):
            model[name] = 0.0


def start_engines(model: jsbsim.FGFDMExec) -> None:
    """Let engines run, and come to the steady state of their throttle, while the aircraft is held."""
    if engines_of(model):
        model.get_propulsion().init_running(-1)
    model.set_trim_status(True)  # actuators and filters follow at once
    model.suspend_integration()
    model.run()
    if engines_of(model):
        model.get_propulsion().get_steady_state()
    model.run()
    model.set_trim_status(False)
    model.resume_integration()


class Bench:
    """An aircraft on the bench."""

    def __init__(self, aircraft: Aircraft) -> None:
        self.aircraft = aircraft
        self.model = load(aircraft)
        self.engines = engines_of(self.model)
        prepare(self.model)
        for name, value in aircraft.properties:
            self.model[name] = value

    def set(self, pose: Pose, commands: Commands) -> None:
        """Put the aircraft into a state, with its engines steady.

        Raises
        ------
        JsbsimError
            If JSBSim fails there.
        """
        model = self.model
        model["ic/lat-geod-deg"], model["ic/long-gc-deg"] = 0.0, 0.0
        model["ic/h-sl-ft"] = pose.altitude / FOOT
        model["ic/psi-true-deg"] = 0.0
        model["ic/vt-fps"] = pose.V / FOOT
        model["ic/phi-rad"] = pose.bank
        model["ic/alpha-rad"], model["ic/beta-rad"] = pose.alpha, pose.beta
        model["ic/gamma-rad"] = pose.gamma
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
        """Return the engines' force along the body x axis, N."""
        return float(self.model["forces/fbx-prop-lbs"]) * POUND if self.engines else 0.0

    def read(self, name: str) -> float | None:
        """Return a property; None if the aircraft has none of that name."""
        return float(self.model[name]) if self.model.get_property_manager().hasNode(name) else None


@functools.cache
def bench_of(aircraft: Aircraft) -> Bench:
    """Return the bench of an aircraft; raises `JsbsimError` if it cannot be loaded."""
    return Bench(aircraft)
