"""The nominal model of an aircraft of JSBSim: our airframe's coefficients, fitted to what accelerates it on the bench.

The coefficients are those of (2.7), by least squares over states around level flight. What JSBSim's aircraft depend on
beyond that (Mach number, ground, propeller wash, rates of angles) is in them as far as it follows from these states.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.jsbsim.terms import SIZES
from ftcc.link.airframe import Airframe, parameters
from ftcc.sim.jsbsim.aircraft import Aircraft, JsbsimError
from ftcc.sim.jsbsim.bench import Bench, Commands, Pose
from ftcc.sim.jsbsim.controls import Controls, controls_of
from ftcc.sim.jsbsim.steady import Steady, steady_flight
from ftcc.sim.jsbsim.units import FOOT, POUND

__all__ = ["Fit", "Identified", "identify"]

Array = NDArray[np.float64]

SAMPLES = 400
"""States on the bench."""
_SPREAD = {"alpha": math.radians(4.0), "beta": math.radians(4.0), "rate": 0.03, "travel": 0.3}
"""Half widths of the states: angles rad; rates in units of 2 V / b and 2 V / c; share of each surface's travel."""

_TERMS = {
    force: tuple(name for name in parameters(Airframe) if name.startswith(force))
    for force in ("CL", "CD", "CY", "Cl", "Cm", "Cn")
}
"""The coefficients of each force and moment, (2.7), by how their names begin."""
_BESIDE = {
    "CL": ("q", "b2"),
    "CD": ("b2", "|b|", "de", "de2", "da2", "dr2"),
    "CY": ("da", "dr", "p", "r"),
    "Cm": ("b2",),
}
"""What also moves them on the bench, and is fitted so that it does not spoil our coefficients, which have no place for
it."""


class Fit(NamedTuple):
    """A force or moment coefficient: as measured and as fitted."""

    measured: Array
    """(n,), less what is fitted beside our coefficients."""
    fitted: Array
    """(n,)."""

    @property
    def determination(self) -> float:
        """Share of the variance that the fit explains, 1 for a perfect one."""
        rest = float(((self.measured - self.fitted) ** 2).sum())
        whole = float(((self.measured - self.measured.mean()) ** 2).sum())
        return 1.0 - rest / whole if whole > 0.0 else 1.0


@dataclass(frozen=True)
class Identified:
    """What `identify` found."""

    aircraft: Aircraft
    V: float
    """m/s, the airspeed around which it was fitted."""
    altitude: float
    """m above mean sea level."""
    airframe: Airframe
    controls: Controls
    steady: Steady
    """Level flight of the aircraft itself."""
    fits: dict[str, Fit]
    """By force and moment coefficient, see (2.7)."""


def identify(aircraft: Aircraft, V: float, altitude: float, seed: int = 1) -> Identified:
    """Fit the coefficients of (2.7) to an aircraft of JSBSim around level flight at ``V`` (m/s) and ``altitude`` (m).

    Raises
    ------
    JsbsimError
        If it cannot be loaded or flown.
    TrimError
        If it has no level flight there.
    """
    controls = controls_of(aircraft, V, altitude)
    steady = steady_flight(aircraft, controls, V, altitude)
    bench = Bench(aircraft)
    throttle = controls.thrust.command(steady.thrust)
    bench.set(Pose(V, altitude, steady.alpha, bank=steady.mu), _commands(controls, steady, {}, throttle))
    size = _size(bench)
    states = _states(size, controls, steady, V, seed)
    measured = np.array([_measure(bench, size, controls, steady, V, altitude, throttle, state) for state in states])
    found, fits = _fit(states, measured, size, V)
    return Identified(aircraft, V, altitude, Airframe(**size, **found), controls, steady, fits)


def _commands(controls: Controls, steady: Steady, surfaces: dict[str, float], throttle: float) -> Commands:
    return Commands(
        controls.aileron.command(surfaces.get("aileron", steady.aileron)),
        controls.elevator.command(surfaces.get("elevator", steady.elevator)),
        controls.rudder.command(surfaces.get("rudder", steady.rudder)),
        throttle,
    )


def _size(bench: Bench) -> dict[str, float]:
    """Return mass, sizes and inertia of an aircraft as it is on the bench, by our names."""

    def read(name: str) -> float:
        value = bench.read(name)
        if value is None or not math.isfinite(value):
            raise JsbsimError(f"{bench.aircraft.name}: has no property {name}")
        return value

    sizes = {name: read(place) * unit for name, (place, unit) in SIZES.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PendingDeprecationWarning)  # it is a numpy matrix
        tensor = np.asarray(bench.model.get_mass_balance().get_J())
    return sizes | {"Ixz": math.copysign(sizes["Ixz"], -float(tensor[0, 2]))}


def _states(size: dict[str, float], controls: Controls, steady: Steady, V: float, seed: int) -> list[dict[str, float]]:
    """Draw states around level flight, spread evenly (a Latin hypercube)."""
    from scipy.stats import qmc  # takes longer to import than all else here

    turning, pitching = _SPREAD["rate"] * 2.0 * V / size["b"], _SPREAD["rate"] * 2.0 * V / size["c"]
    widths = {
        "alpha": (steady.alpha, _SPREAD["alpha"]),
        "beta": (0.0, _SPREAD["beta"]),
        "p": (0.0, turning),
        "q": (0.0, min(pitching, 4.0 * turning)),
        "r": (0.0, turning),
    }
    for name in ("aileron", "elevator", "rudder"):
        if name not in controls.missing:
            control, at = getattr(controls, name), getattr(steady, name)
            room = min(_SPREAD["travel"] * 0.5 * (control.most - control.least), control.most - at, at - control.least)
            widths[name] = (at, room)
    draws = qmc.LatinHypercube(len(widths), rng=np.random.default_rng(seed)).random(SAMPLES)
    return [
        {
            name: middle + width * (2.0 * draw - 1.0)
            for (name, (middle, width)), draw in zip(widths.items(), row, strict=True)
        }
        for row in draws.tolist()
    ]


def _measure(
    bench: Bench,
    size: dict[str, float],
    controls: Controls,
    steady: Steady,
    V: float,
    altitude: float,
    throttle: float,
    state: dict[str, float],
) -> list[float]:
    """Return CL, CD, CY, Cl, Cm, Cn on the bench.

    Forces are the air's alone, moments are all: what a propeller or an engine below the wing adds is in them.
    """
    pose = Pose(V, altitude, state["alpha"], state["beta"], steady.mu, 0.0, state["p"], state["q"], state["r"])
    bench.set(pose, _commands(controls, steady, state, throttle))

    def read(name: str) -> float:
        return float(bench.model[name])

    ca, sa, cb, sb = math.cos(pose.alpha), math.sin(pose.alpha), math.cos(pose.beta), math.sin(pose.beta)
    fx, fy, fz = (read(f"forces/fb{axis}-aero-lbs") * POUND for axis in "xyz")
    along = ca * cb * fx + sb * fy + sa * cb * fz
    side = -ca * sb * fx + cb * fy - sa * sb * fz
    down = -sa * fx + ca * fz
    pressure = 0.5 * size["rho"] * V * V * size["S"]
    moments = [read(f"moments/{axis}-total-lbsft") * POUND * FOOT for axis in "lmn"]
    arms = (size["b"], size["c"], size["b"])
    return [
        -down / pressure,
        -along / pressure,
        side / pressure,
        *(moment / (pressure * arm) for moment, arm in zip(moments, arms, strict=True)),
    ]


def _fit(
    states: list[dict[str, float]], measured: Array, size: dict[str, float], V: float
) -> tuple[dict[str, float], dict[str, Fit]]:
    """Return the coefficients, by name, and the fit of each force and moment."""
    names_of_states = ("alpha", "beta", "p", "q", "r", "aileron", "elevator", "rudder")
    column = {name: np.array([state.get(name, 0.0) for state in states]) for name in names_of_states}
    one, span, chord = np.ones(len(states)), size["b"] / (2.0 * V), size["c"] / (2.0 * V)
    behind = {
        "0": one,
        "a": column["alpha"],
        "a2": column["alpha"] ** 2,
        "b": column["beta"],
        "de": column["elevator"],
        "da": column["aileron"],
        "dr": column["rudder"],
        "p": span * column["p"],
        "q": chord * column["q"],
        "r": span * column["r"],
        "b2": column["beta"] ** 2,
        "|b|": np.abs(column["beta"]),
        "de2": column["elevator"] ** 2,
        "da2": column["aileron"] ** 2,
        "dr2": column["rudder"] ** 2,
    }
    found: dict[str, float] = {}
    fits: dict[str, Fit] = {}
    for n, (force, names) in enumerate(_TERMS.items()):
        ours = [behind[name.removeprefix(force)] for name in names]
        beside = [behind[name] for name in _BESIDE.get(force, ())]
        matrix = np.column_stack([*ours, *beside])
        values, *_ = np.linalg.lstsq(matrix, measured[:, n], rcond=None)
        found |= dict(zip(names, values.tolist(), strict=False))
        rest = np.column_stack(beside) @ values[len(ours) :] if beside else 0.0
        fits[force] = Fit(measured[:, n] - rest, matrix[:, : len(ours)] @ values[: len(ours)])
    return found, fits
