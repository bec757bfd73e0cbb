"""Flies swarms with a liar, undefended and defended: ``python docs/lying_studies.py [--flights N] [SCHEME ...]``.

For each chapter 12 followers, on a graph that is strongly 3-robust with its leaders trusted (each hears its 8 nearest),
and on a ring, which is not. In each flight one follower, drawn at random, tells its neighbours a random lie from 25 s
on. The table says of how many flights an honest follower was carried off: beyond the leaders' altitudes, or off its
post at the fire, by more than 2 m; and the median of the farthest.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside import Flight, load, simulate
from ftcc.groundside.generator import Request, make_scenario

VALUES = {
    "prescribed_performance": ["zhat"],
    "nearest_neighbour": ["z"],
    "containment": ["zhat"],
    "finite_time_containment": ["z_hat"],
    "fire_monitoring": ["Pt_x", "Pt_y", "Pt_z"],
}
"""By scheme, the values that are lied about."""
GATE = {"jump": 1.0, "jump_speed": 2.0, "most_speed": 60.0, "most_accel": 20.0, "ban": 60.0}
TRUST = {"past": 1.5, "crowd": 15.0, "recovery": 60.0}
DEFENCES: dict[str, dict[str, float]] = {
    "none": {},
    "gate": GATE,
    "trust": TRUST,
    "W-MSR, F = 1": {"F": 1},
    "hull, F = 1": {"hull": 1},
    "gate, trust, W-MSR": {**GATE, **TRUST, "F": 1},
}
GRAPHS = {"robust": "nearest:8", "ring": "ring"}
AT, UNTIL = 25.0, 60.0
"""When the lie begins, and the flight ends, s."""
CARRIED_OFF = 2.0
"""Distance that counts, m."""


def lies(scheme: str, flights: int) -> Iterator[dict[str, Any]]:
    """As many random lies; the same for every graph and defence."""
    random = np.random.default_rng(1)
    for _ in range(flights):
        kind = str(random.choice(["offset", "drift", "oscillate"]))
        size = float(random.uniform(20.0, 80.0) * random.choice([-1.0, 1.0]))
        lie: dict[str, Any] = {"at": AT, "kind": kind, "uav": int(random.integers(1, 13)), "signals": VALUES[scheme]}
        lie["size"] = abs(size) if kind == "oscillate" else size
        if kind == "drift":
            lie["rate"] = float(np.copysign(random.uniform(1.0, 8.0), size))
        if kind == "oscillate":
            lie["period"] = float(random.uniform(4.0, 20.0))
        yield lie


def farthest(flight: Flight, liar: int | None) -> float:
    """How far an honest follower was carried off at worst since the lie began, m."""
    graph = flight.mission.graph
    honest = [uav for uav in graph.followers if uav != liar and uav not in flight.lost]
    late = flight.t >= AT
    if not graph.leaders:
        return max(
            float(np.sqrt(sum(flight.column(f"Pt_{axis}", uav)[late] ** 2 for axis in "xyz")).max()) for uav in honest
        )
    led = np.array([flight.column("z", uav) for uav in graph.leaders])[:, late]
    low, high = led.min(axis=0), led.max(axis=0)
    z = np.array([flight.column("z", uav)[late] for uav in honest])
    return max(float(np.maximum(z - high, low - z).max()), 0.0)


def study(scheme: str, flights: int, folder: Path) -> Iterator[str]:
    """The rows of the table for one scheme."""
    for word, graph in GRAPHS.items():
        file = folder / f"{scheme}-{word}.toml"
        made = make_scenario(Request(scheme, 12, graph=graph, faults=0, duration=UNTIL), "docs/lying_studies.py")
        file.write_text(made.text, encoding="utf-8")
        trusted = ["leaders"] if load(file).plan.uavs.leaders else []
        for name, gains in DEFENCES.items():
            defence = {"defence": {**gains, "trusted": trusted}} if gains else {}
            alone = farthest(simulate(file, form="flight", settings=defence), None)
            found = [
                farthest(simulate(file, form="flight", settings={**defence, "attacks": [lie]}), lie["uav"])
                for lie in lies(scheme, flights)
            ]
            off = sum(distance > CARRIED_OFF for distance in found)
            yield f"| {scheme} | {word} | {name} | {alone:.2f} | {off} of {flights} | {np.median(found):.2f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("schemes", nargs="*", default=list(VALUES), metavar="SCHEME")
    parser.add_argument("--flights", type=int, default=20)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    print(
        "| scheme | graph | defence | without a lie, m | carried off | median, m |\n|---|---|---|---|---|---|",
        flush=True,
    )
    with tempfile.TemporaryDirectory() as folder:
        for scheme in options.schemes:
            for row in study(scheme, options.flights, Path(folder)):
                print(row, flush=True)


if __name__ == "__main__":
    main()
