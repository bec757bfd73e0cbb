"""Linear modes of an aircraft of JSBSim about steady flight."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ftcc.sim.jsbsim.aircraft import Aircraft
from ftcc.sim.jsbsim.bench import Bench, Commands, Pose
from ftcc.sim.jsbsim.controls import Controls
from ftcc.sim.jsbsim.steady import steady_flight
from ftcc.sim.linear_modes import Mode, modes_of

__all__ = ["linear_modes"]

_LONGITUDINAL, _LATERAL = ("u", "w", "q", "theta"), ("v", "p", "r", "phi")
_STATES = (*_LONGITUDINAL, *_LATERAL)
_STEP = {"u": 0.1, "v": 0.1, "w": 0.1}
"""Of the central differences, m/s; of angles and rates, rad and rad/s:"""
_TURN = 1e-3


def linear_modes(aircraft: Aircraft, controls: Controls, V: float, altitude: float) -> list[Mode]:
    """Modes in level flight at ``V`` (m/s) and ``altitude`` (m), with throttle and surfaces fixed.

    Engines are steady at each airspeed; couplings between longitudinal and lateral motion are left out.

    Raises
    ------
    TrimError
        If there is no level flight.
    """
    steady = steady_flight(aircraft, controls, V, altitude)
    bench = Bench(aircraft)
    commands = controls.commands(steady.aileron, steady.elevator, steady.rudder, steady.thrust)
    at = {
        "u": V * math.cos(steady.alpha), "v": 0.0, "w": V * math.sin(steady.alpha),
        "theta": steady.alpha, "phi": steady.mu, "p": 0.0, "q": 0.0, "r": 0.0,
    }  # fmt: skip
    matrix = np.zeros((len(_STATES), len(_STATES)))
    for n, name in enumerate(_STATES):
        step = _STEP.get(name, _TURN)
        more = _rates(bench, at | {name: at[name] + step}, altitude, commands)
        less = _rates(bench, at | {name: at[name] - step}, altitude, commands)
        matrix[:, n] = (more - less) / (2.0 * step)
    border = len(_LONGITUDINAL)
    return modes_of(matrix[:border, :border], matrix[border:, border:])


def _rates(bench: Bench, state: dict[str, float], altitude: float, commands: Commands) -> NDArray[np.float64]:
    """Rates of `_STATES`."""
    u, v, w = state["u"], state["v"], state["w"]
    V = math.sqrt(u * u + v * v + w * w)
    theta, phi = state["theta"], state["phi"]
    # JSBSim takes the path angle: that of this velocity under these Euler angles.
    up = u * math.sin(theta) - v * math.sin(phi) * math.cos(theta) - w * math.cos(phi) * math.cos(theta)
    pose = Pose(
        V, altitude, math.atan2(w, u), math.asin(v / V), phi, math.asin(up / V), state["p"], state["q"], state["r"]
    )
    bench.set(pose, commands)
    found = bench.accelerations()
    theta_dot = state["q"] * math.cos(phi) - state["r"] * math.sin(phi)
    phi_dot = state["p"] + math.tan(theta) * (state["q"] * math.sin(phi) + state["r"] * math.cos(phi))
    return np.array([found.u_dot, found.w_dot, found.q_dot, theta_dot, found.v_dot, found.p_dot, found.r_dot, phi_dot])
