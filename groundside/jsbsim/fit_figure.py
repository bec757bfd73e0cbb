"""The figure of an identified aircraft: the fit of each coefficient, and a doublet of each surface in both models."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.jsbsim.identification import Identified
from ftcc.link.actuators import AILERON, ELEVATOR, RUDDER
from ftcc.link.rotation import body_attitude
from ftcc.sim.jsbsim.flight import FlownAircraft, Modelled, ModelState
from ftcc.sim.plants import attitude, jsbsim

__all__ = ["Response", "draw_fit", "respond"]

Array = NDArray[np.float64]

_STEP_US = 2000
_SLOTS = {"elevator": ELEVATOR, "aileron": AILERON, "rudder": RUDDER}
_SHOWN = {"elevator": ("q", "alpha"), "aileron": ("p", "mu"), "rudder": ("r", "beta")}
"""What is drawn of each surface's doublet."""
_PLACES = {"mu": 6, "alpha": 7, "beta": 8, "p": 10, "q": 11, "r": 12}
"""In the truth vector, see ``plant.TRUTH``."""
_SHARE, _MOST = 0.5, 0.05
"""Size of a doublet, at most: share of the room between level flight and the nearer end of the travel; rad."""


class Response(NamedTuple):
    """A doublet of a surface: its true states by JSBSim and by the fitted equations, each from its own level flight."""

    t: Array
    """(n,): s."""
    deflection: Array
    """(n,): off level flight, rad."""
    model: Array
    """(n, 13): JSBSim's, see ``plant.TRUTH``."""
    fitted: Array
    """(n, 13)."""


def respond(found: Identified, surface: str, duration: float, pulse: float) -> Response:
    """Fly a doublet of a surface, which holds each of its two sides for ``pulse`` (s), in both models."""
    from ftcc.sim.trim import trim

    control, at = getattr(found.controls, surface), getattr(found.steady, surface)
    size = min(_MOST, _SHARE * min(control.most - at, at - control.least))
    steps = int(duration * 1e6) // _STEP_US
    t = np.linspace(0.0, steps * _STEP_US / 1e6, steps + 1)
    deflection = size * ((t < pulse).astype(float) - ((t >= pulse) & (t < 2.0 * pulse)))
    slot = _SLOTS[surface]
    steady = found.steady
    own = np.array([steady.aileron, steady.elevator, steady.rudder, steady.thrust])
    level = trim(found.airframe, found.V)
    a = found.airframe
    # Where rolling and yawing moments of the fitted model vanish, which a propeller shifts.
    turning = np.linalg.solve(np.array([[a.Clda, a.Cldr], [a.Cnda, a.Cndr]]), np.array([-a.Cl0, -a.Cn0]))
    fitted = np.array([turning[0], level.elevator, turning[1], level.thrust])
    return Response(
        t,
        deflection,
        _fly_model(found, own, slot, deflection),
        _fly_fitted(found, level.alpha, fitted, slot, deflection),
    )


def _fly_model(found: Identified, command: Array, slot: int, deflection: Array) -> Array:
    flown = FlownAircraft(found.aircraft, found.controls, (0.0, 0.0, 0.0), found.altitude, _STEP_US, 0)
    model = Modelled(flown, 1)
    attitude_at_start = body_attitude(0.0, 0.0, found.steady.mu, found.steady.alpha, 0.0)
    state = np.array([0.0, 0.0, found.altitude, found.V, 0.0, 0.0, *attitude_at_start, 0.0, 0.0, 0.0])
    driven = np.array([*command, 0.0, 0.0, 0.0])
    model.begin(state, driven)
    rows = np.zeros((len(deflection), 13))
    for n, off in enumerate(deflection):
        jsbsim.truth(ModelState(*state.tolist()), None, 0.0, rows[n])
        driven[slot] = command[slot] + off
        model.step(driven, state)
    return rows


def _fly_fitted(found: Identified, alpha: float, command: Array, slot: int, deflection: Array) -> Array:
    state = np.array([*attitude.initial({"V": found.V, "z": found.altitude}, {"alpha": alpha})])
    calm, h = attitude.Disturbances(*(0.0,) * len(attitude.DISTURBANCES)), _STEP_US / 1e6
    rows = np.zeros((len(deflection), 13))
    acting = command.copy()

    def rates(x: Array) -> Array:
        return np.array(
            attitude.rates(attitude.State(*x.tolist()), attitude.Inputs(*acting.tolist()), calm, found.airframe)
        )

    for n, off in enumerate(deflection):
        attitude.truth(attitude.State(*state.tolist()), None, 0.0, rows[n])
        acting[slot] = command[slot] + off
        a = rates(state)
        b = rates(state + 0.5 * h * a)
        c = rates(state + 0.5 * h * b)
        d = rates(state + h * c)
        state += h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return rows


def draw_fit(found: Identified, file: Path) -> None:
    """Draw the fits and the responses into a file.

    Raises
    ------
    OSError, ValueError
        If it cannot be written.
    """
    from ftcc.groundside.canvas import plt

    figure, axes = plt.subplots(2, 6, figsize=(17.0, 6.0), layout="constrained")
    for axis, (name, fit) in zip(axes[0], found.fits.items(), strict=True):
        axis.plot(fit.measured, fit.fitted, ".", markersize=2.5)
        ends = [min(fit.measured.min(), fit.fitted.min()), max(fit.measured.max(), fit.fitted.max())]
        axis.plot(ends, ends, color="gray", linewidth=0.8)
        axis.set(title=f"{name}, R² = {fit.determination:.4f}", xlabel="JSBSim", ylabel="fitted")
        axis.grid(alpha=0.3)
    column = 0
    pitching = max(0.5, min(4.0, 6.0 / _frequency(found)))
    for surface, shown in _SHOWN.items():
        if surface in found.controls.missing:
            continue
        response = respond(found, surface, 8.0 * pitching, 0.5 * pitching)
        for name in shown:
            axis, place = axes[1][column], _PLACES[name]
            for rows, label, style in ((response.model, "JSBSim", "-"), (response.fitted, "fitted", "--")):
                axis.plot(response.t, np.degrees(rows[:, place] - rows[0, place]), style, label=label)
            unit = "deg/s" if name in "pqr" else "deg"
            axis.set(title=f"{name} by {surface}", xlabel="t, s", ylabel=unit)
            axis.grid(alpha=0.3)
            column += 1
    for axis in axes[1][column:]:
        axis.set_visible(False)
    axes[1][0].legend()
    figure.suptitle(
        f"{found.aircraft.title} of JSBSim at {found.V:g} m/s and {found.altitude:g} m, and its nominal model"
    )
    figure.savefig(file, dpi=110)
    plt.close(figure)


def _frequency(found: Identified) -> float:
    """Natural frequency in pitch, rad/s."""
    a = found.airframe
    return float(np.sqrt(max(-a.Cma, 0.05) * 0.5 * a.rho * found.V**2 * a.S * a.c / a.Iy))
