"""Swarms of any size to measure with: containment (chapter 5) around a ring of local leaders, as a scenario file.

Two leaders cannot contain a hundred followers in reasonable time: along a chain of neighbours an estimate takes the
square of its length to settle. Here a leader is heard by the follower on each side of it, followers hear their
neighbours on the ring, and between two leaders there are about seven. Every second leader climbs, so that there is
something to do; everybody starts in the leaders' hull. The smallest swarm is a leader and its one follower.
"""

from __future__ import annotations

from pathlib import Path

import tomli_w

__all__ = ["swarm_file"]

_BETWEEN = 7
"""Followers between two leaders, about."""
_APART = 30.0
"""Between two aircraft side by side, m."""


def swarm_file(folder: Path, uavs: int, duration: float = 60.0) -> Path:
    """Write the scenario of a swarm of so many UAVs (2 to 200, leaders among them); its path."""
    leaders = 1 if uavs == 2 else max(2, round(uavs / (_BETWEEN + 1)))
    path = folder / f"ring-{uavs}.toml"
    path.write_text(tomli_w.dumps(_scenario(uavs - leaders, leaders, duration)), encoding="utf-8")
    return path


def _scenario(followers: int, leaders: int, duration: float) -> dict[str, object]:
    flock = list(range(1, followers + 1))
    heads = list(range(followers + 1, followers + leaders + 1))
    edges: list[dict[str, object]] = []
    # A leader stands before the first follower of its group, and behind the last one of the group before.
    first = [flock[n * followers // leaders] for n in range(leaders)]
    for head, uav in zip(heads, first, strict=True):
        edges.append({"from": head, "to": uav, "weight": 0.8})
        if followers > leaders:
            edges.append({"from": head, "to": flock[flock.index(uav) - 1], "weight": 0.8})
    for n, uav in enumerate(flock):
        behind = flock[n - 1]
        if followers > 2 or n > 0:
            edges.append({"between": [behind, uav], "weight": 0.2 if uav in first else 0.4})
    return {
        "title": f"{followers} followers around a ring of {leaders} local leaders",
        "scheme": "containment",
        "duration": duration,
        "uavs": {"followers": flock, "leaders": heads},
        "graph": {"edges": edges},
        "rates": {"control_rate": 100.0, "exchange_rate": 20.0, "latency": 0.05},
        "mission": {"V": 30.0},
        "start": {"V": 30.0, "z": 1000.0, "theta": "trim", "uav": {str(u): {"y": _APART * u} for u in flock}},
        "leaders": {
            str(head): {
                "y": _APART * uav - 15.0,
                "z": 1000.0,
                "V": 30.0,
                "altitude_filter": {"frequency": 0.06, "damping": 0.9},
                "commands": [{"at": 5.0, "altitude": 1060.0}] if n % 2 else [],
            }
            for n, (head, uav) in enumerate(zip(heads, first, strict=True))
        },
        "plant": {
            "fault": "after_lag",
            "initial_actuators": "trim",
            "limits": {"thrust": [0.0, 40.0], "elevator": [-0.7, 0.7]},
            "lag": {"thrust": 20.0, "elevator": 20.0},
        },
        "gains": {"in_flight": 1.0},
        "disturbances": [{"at": 10.0, "d1": 0.2, "d2": 0.1, "d3": 0.1}],
        "faults": [{"at": 20.0, "uav": 1, "actuator": "elevator", "effectiveness": 0.7, "bias": 0.2}],
        "claims": [
            {
                "name": "altitude tracking error",
                "metric": "max_abs",
                "signal": "z - z_r",
                "window": [5.0, duration],
                "unit": "m",
                "source": "nothing published: a swarm to measure with must fly soundly",
                "expected": {"flight": 0.0},
                "tolerance": "< 3",
            }
        ],
    }
