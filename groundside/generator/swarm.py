"""The tables of a swarm that differ with its size: who flies where, leaders' profiles, attitudes, posts, faults."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftcc.airside.references.position import Command, Fire, Reference, start
from ftcc.airside.scheme import Scheme
from ftcc.groundside.generator.request import Request
from ftcc.link.graph import Graph

__all__ = ["DrawnFault", "abreast", "drawn_faults", "fire_tables", "flying_tables", "turning_tables"]

_ALTITUDE, _APART = 1000.0, 30.0
"""Of the leaders together, and between the highest and the lowest later, m."""
_STEP = 25.0
"""Climb of a single leader, m."""
_DEPTH = 40.0
"""Of leaders behind one another, where the scheme keeps them so, m: as in chapter 6, there 120 m."""
_LAYERS, _LAYER = 4, 5.0
"""Altitudes of the posts around a fire: so many, so far apart, m."""
_SEVERE = {
    "thrust": (0.3, 2.0),
    "load_factor": (0.15, 0.05),
    "bank": (0.15, 0.05),
    "aileron": (0.4, 0.1),
    "elevator": (0.4, 0.1),
    "rudder": (0.4, 0.1),
}
"""By actuator the largest loss of effectiveness and the largest bias that are drawn."""


class DrawnFault(NamedTuple):
    """A fault of an actuator."""

    at: float
    """s."""
    uav: int
    actuator: str
    effectiveness: float
    bias: float


def drawn_faults(request: Request, graph: Graph, scheme: Scheme, severity: float) -> list[DrawnFault]:
    """Return faults of different followers, spread over the second quarter of the flight.

    ``severity`` scales the largest loss and bias. Times, UAVs and actuators are the same at every severity.
    """
    draws = np.random.Generator(np.random.Philox(request.seed))
    uavs = sorted(draws.permutation(graph.followers)[: request.faults].tolist())
    commands = ["elevator"] if scheme.plant == "longitudinal" else list(scheme.commands)
    faults = []
    for n, uav in enumerate(uavs):
        actuator = commands[int(draws.integers(len(commands)))]
        loss, bias = _SEVERE[actuator]
        if scheme.plant == "attitude" and actuator == "elevator":
            bias /= 2.0  # its trim needs most of the travel
        at = request.duration * (0.25 + 0.25 * n / request.faults)
        remaining = 1.0 - severity * loss * (0.5 + 0.5 * draws.random())
        shift = severity * bias * draws.uniform(-1.0, 1.0)
        faults.append(DrawnFault(round(at, 2), uav, actuator, round(remaining, 2), round(shift, 3)))
    return faults


def abreast(n: int, count: int, spacing: float) -> float:
    """Return the lateral position of member ``n`` of ``count`` flying side by side, m."""
    return (n - (count - 1) / 2.0) * spacing


def flying_tables(request: Request, graph: Graph, forward: bool) -> str:
    """Return ``[mission]``, ``[start]`` and the leaders of a swarm whose leaders fly ahead in the vertical plane.

    ``forward``: positions along the track are controlled, too, and the leaders' differ.
    """
    draws = np.random.Generator(np.random.Philox(request.seed + 1))
    count, leaders = len(graph.followers), len(graph.leaders)
    low, high = (_levels(0, leaders), _levels(leaders - 1, leaders)) if forward else (_ALTITUDE, _ALTITUDE)
    depth = _DEPTH * max(leaders - 1, 0)
    lines = [
        "[mission]                   # what every follower knows",
        "V = 30.0                    # m/s",
        "",
        "[start]                     # in level flight",
        "V = 30.0                    # m/s",
        'theta = "trim"              # rad',
        "",
        "[start.uav]                 # m: side by side, some metres too high or too low",
    ]
    for n, uav in enumerate(graph.followers):
        z = draws.uniform(low, high) if forward and high > low else _ALTITUDE + draws.uniform(-3.0, 3.0)
        x = f"x = {draws.uniform(0.0, depth):.1f}, " if forward else ""
        lines.append(f"{uav} = {{ {x}y = {abreast(n, count, request.spacing):.1f}, z = {z:.1f} }}")
    for n, uav in enumerate(graph.leaders):
        side = (-1.0 if n % 2 == 0 else 1.0) * (count / 2.0 + n // 2 + 0.5) * request.spacing
        begin = _levels(n, leaders) if forward else _ALTITUDE
        end = _ALTITUDE + _STEP if leaders == 1 else _levels(n, leaders) + (_STEP if forward else 0.0)
        lines += ["", f"[leaders.{uav}]"]
        lines += [f"x = {_DEPTH * n:.1f}                   # m"] if forward else []
        lines += [
            f"y = {side:.1f}",
            f"z = {begin:.1f}",
            "V = 30.0",
            *(["forward = true"] if forward else []),
            "altitude_filter = { frequency = 0.12, damping = 0.9 }",
            f"commands = [{{ at = 5.0, altitude = {end:.1f} }}]",
        ]
    return "\n".join(lines)


def _levels(n: int, leaders: int) -> float:
    """Altitude of leader ``n`` when they have parted, m."""
    return _ALTITUDE + (_APART * (n / (leaders - 1) - 0.5) if leaders > 1 else 0.0)


def turning_tables(request: Request, graph: Graph) -> str:
    """Return ``[attitude]`` and ``[start]`` of a swarm that turns together."""
    draws = np.random.Generator(np.random.Philox(request.seed + 1))
    lines = [
        "[attitude]                  # rad: all bank by 10 degrees, and level off again",
        "filter = { frequency = 0.9, damping = 0.9 }",
        "commands = [",
        "    { at = 0.0, bank = 0.0, alpha = 0.034906585, sideslip = 0.0 },",
        "    { at = 3.0, bank = 0.174532925, alpha = 0.087266463 },",
        f"    {{ at = {0.6 * request.duration:g}, bank = 0.0, alpha = 0.034906585 }},",
        "]",
        "",
        "[start]",
        "V = 30.0                    # m/s",
        "z = 1000.0                  # m",
        "gamma = 0.0                 # rad",
        "",
        "[start.uav]                 # attitudes, rad; side by side, m",
    ]
    for n, uav in enumerate(graph.followers):
        mu, alpha, beta = draws.uniform((-0.02, 0.03, -0.02), (0.02, 0.05, 0.02))
        y = abreast(n, len(graph.followers), request.spacing)
        lines.append(f"{uav} = {{ mu = {mu:.4f}, alpha = {alpha:.4f}, beta = {beta:.4f}, y = {y:.1f} }}")
    return "\n".join(lines)


def fire_tables(request: Request, graph: Graph, fire: str) -> str:
    """Return ``[fire.posts]`` and ``[start]`` of a swarm around a fire, given the shipped table ``[fire]``."""
    given = tomllib.loads(fire)["fire"]
    place = [given["outbreak"][axis] + given["drift"][axis] * given["age"] for axis in range(2)]
    north, east = given["spread"]
    commands = (Command(0.0, place[0], place[1], *given["drift"]),)
    posts = [f"least_distance = {request.spacing:g}        # m, between two posts", "", "[fire.posts]"]
    starts = ["[start]", "V = 47.0                    # m/s", "gamma = 0.0                 # rad", "", "[start.uav]"]
    starts[-1] += "                 # on the posts"
    count = len(graph.followers)
    for n, uav in enumerate(graph.followers):
        phase, altitude = 2.0 * math.pi * n / count, 100.0 + _LAYER * (n % _LAYERS)
        parameters = Fire(north, east, given["age"], given["omega"], phase, 0.0, 0.0, altitude, 4.0, 0.2)
        at = Reference(*start(parameters, commands))
        speed, chi = math.hypot(at.x_dot, at.y_dot), math.atan2(at.y_dot, at.x_dot)
        posts.append(f"{uav} = {{ phase = {phase:.6f}, altitude = {altitude:.1f} }}")
        starts.append(
            f"{uav} = {{ x = {at.x:.1f}, y = {at.y:.1f}, z = {altitude:.1f}, V = {speed:.1f}, chi = {chi:.4f} }}"
        )
    return "\n".join([*posts, "", *starts])


def fault_lines(faults: Sequence[DrawnFault]) -> list[str]:
    """Return a line for each fault."""
    return [
        f'    {{ at = {f.at:g}, uav = {f.uav}, actuator = "{f.actuator}", effectiveness = {f.effectiveness:g}, '
        f"bias = {f.bias:g} }},"
        for f in faults
    ]
