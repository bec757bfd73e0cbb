"""The nominal model that a law knows: control-oriented longitudinal dynamics and the limits of its actuators.

`attitude_model` has the rest of it. `ftcc.sim.airframe` has the true equations: they stand twice on purpose, and a law
sees its own alone. No elevator lift and no T sin(alpha) here: the laws treat both as disturbances, as the monograph
does.
"""

from __future__ import annotations

import math

from ftcc.airside.elements.nonlinear import clip
from ftcc.link.airframe import Airframe, with_inherited_fields
from ftcc.link.compiled import compiled

__all__ = ["Model", "airspeed_model", "flight_path_model", "level_deflections", "level_flight", "pitch_rate_model"]

_LARGEST_ALPHA = 1.0
"""Guard of the angle of attack, rad."""
_LEAST_AIRSPEED = 1.0
"""Guard of the airspeed in level flight, m/s."""


@with_inherited_fields
class Model(Airframe):
    """The nominal parameters of an aircraft, and the limits of its actuators: thrust in N, deflections in rad."""

    thrust_min: float
    thrust_max: float
    elevator_min: float
    elevator_max: float
    aileron_min: float
    aileron_max: float
    rudder_min: float
    rudder_max: float
    lag: float
    """Bandwidth of the actuators, rad/s; 0 = none."""


@compiled
def airspeed_model(V, gamma, alpha, a):
    """f_v (m/s^2) and g_v (1/kg) of V' = f_v + g_v T; in g_v abs(alpha) is at most `_LARGEST_ALPHA`."""
    lifting = 0.5 * a.rho * V * V * a.S
    drift = -lifting * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha * alpha) / a.m - a.g * math.sin(gamma)
    return drift, math.cos(clip(alpha, -_LARGEST_ALPHA, _LARGEST_ALPHA)) / a.m


@compiled
def flight_path_model(V, gamma, divisor, a):
    """f_g (rad/s) and g_g (1/s) of gamma' = f_g + g_g theta; ``divisor`` is the airspeed guarded against zero."""
    lifting = 0.5 * a.rho * V * V * a.S
    drift = (-a.m * a.g * math.cos(gamma) + lifting * a.CL0 - lifting * a.CLa * gamma) / (a.m * divisor)
    return drift, lifting * a.CLa / (a.m * divisor)


@compiled
def pitch_rate_model(V, alpha, q, divisor, a):
    """f_q (rad/s^2) and g_q (1/s^2) of q' = f_q + g_q elevator."""
    moment = 0.5 * a.rho * V * V * a.S * a.c / a.Iy
    drift = moment * (a.Cm0 + a.Cma * alpha + a.Cmq * a.c * q / (2.0 * divisor))
    return drift, moment * a.Cmde


@compiled
def level_flight(V, a):
    """Angle of attack (rad), thrust (N) and elevator (rad) of level flight at airspeed ``V``, by the nominal model."""
    speed = max(V, _LEAST_AIRSPEED)
    lifting = 0.5 * a.rho * speed * speed * a.S
    # Here the elevator's lift counts: the pitching moment is balanced, Cm0 + Cma alpha + Cmde elevator = 0.
    share = a.CLde / a.Cmde
    alpha = (a.m * a.g / lifting - a.CL0 + share * a.Cm0) / (a.CLa - share * a.Cma)
    drag = lifting * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha * alpha)
    return alpha, drag / math.cos(alpha), -(a.Cm0 + a.Cma * alpha) / a.Cmde


def level_deflections(V: float, a: Model) -> dict[str, float]:
    """Thrust (N) and elevator (rad) of level flight at airspeed ``V`` (m/s), by the nominal model."""
    _, thrust, elevator = level_flight(V, a)
    return {"thrust": thrust, "elevator": elevator}
