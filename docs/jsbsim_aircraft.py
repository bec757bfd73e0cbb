"""Our laws on two aircraft of JSBSim: ``python docs/jsbsim_aircraft.py`` prints the tables and draws the figures.

Needs the extra ``jsbsim``, and six minutes. `jsbsim-aircraft.md` shows what it found; claims of the scenarios hold it.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from docs.markdown_tables import table  # noqa: E402
from ftcc.groundside.canvas import STYLE, plt  # noqa: E402
from ftcc.groundside.claims import evaluate, evaluate_expression  # noqa: E402
from ftcc.groundside.jsbsim import draw_fit, identify, scale_of  # noqa: E402
from ftcc.groundside.scenario import load, resolve  # noqa: E402
from ftcc.groundside.simulation import Flight, fly_in_memory  # noqa: E402
from ftcc.sim.jsbsim.aircraft import Aircraft  # noqa: E402

PICTURES = Path(__file__).parent / "pictures"
AIRCRAFT = {"c172p": (50.0, 1000.0), "737": (180.0, 3000.0)}
"""m/s and m."""
VARIANTS = {"c172p": (), "737": ("b737",)}
SCENARIOS = ("jsbsim_containment", "jsbsim_attitude", "jsbsim_fire")


class Drawn(NamedTuple):
    """What is drawn of a scenario: the largest error of all UAVs."""

    error: str
    label: str


DRAWN = {
    "jsbsim_containment": Drawn("abs(z - z_d)", "altitude off its place, m"),
    "jsbsim_attitude": Drawn("abs(degrees(wrapped(mu - mu_d)))", "bank error, deg"),
    "jsbsim_fire": Drawn("sqrt((x - x_ref)**2 + (y - y_ref)**2 + (z - z_ref)**2)", "position error, m"),
}


def fly(scenario: str, variants: tuple[str, ...]) -> tuple[Flight, float]:
    """Fly a case in one process; returns it, and simulated seconds per second."""
    mission = resolve(load(scenario, variants=variants))
    begun = 0.0

    def ready() -> None:
        nonlocal begun
        begun = time.perf_counter()

    flight = fly_in_memory(mission, ready=ready)
    return flight, mission.timing.duration / (time.perf_counter() - begun)


def largest(flight: Flight, error: str) -> tuple[np.ndarray, np.ndarray]:
    """Time (s) and the largest error of all followers."""
    followers = flight.mission.graph.followers
    rows = min(len(flight.column("t", uav)) for uav in followers)
    errors = [evaluate_expression(error, flight, flight.mission.graph, uav)[:rows] for uav in followers]
    return flight.column("t", followers[0])[:rows], np.max(errors, axis=0)


def print_aircraft() -> None:
    """The two aircraft beside the reference airframe, and the scale of their gains."""
    rows = []
    for name, (V, altitude) in AIRCRAFT.items():
        found = identify(Aircraft(name), V, altitude)
        draw_fit(found, PICTURES / f"jsbsim_fit_{name}.png")
        scale = scale_of(found.airframe, V)
        a = found.airframe
        least = min(fit.determination for fit in found.fits.values())
        rows.append(
            [
                name,
                f"{a.m:.0f} kg",
                f"{a.b:.1f} m",
                f"{V:g} m/s",
                f"{scale.time:.2f}",
                f"{scale.speed:.2f}",
                f"{least:.3f}",
            ]
        )
    print(table(["aircraft", "mass", "span", "airspeed", "times x", "speeds x", "least R²"], rows))


def print_claims(flights: dict[tuple[str, str, str], Flight]) -> None:
    """Every claim of every case, as measured."""
    for scenario in SCENARIOS:
        claims: dict[str, dict[str, str]] = {}
        cases = [key for key in flights if key[0] == scenario]
        for key in cases:
            mission = flights[key].mission
            for result in evaluate(flights[key], mission.claims, mission.case, mission.graph):
                shown = "-" if result.value is None else f"{result.value:.3g}"
                mark = "" if result.ok else " (no)"
                claims.setdefault(result.claim.name, {})[key[1] + key[2]] = f"{shown}{mark} {result.claim.unit}".strip()
        heads = [f"{aircraft}{', ' + what if what else ''}" for _, aircraft, what in cases]
        rows = [[name, *(cells.get(key[1] + key[2], "") for key in cases)] for name, cells in claims.items()]
        print(f"\n{scenario}\n\n{table(['claim', *heads], rows)}")


def main() -> None:
    plt.rcParams.update(STYLE)
    print_aircraft()
    figure, axes = plt.subplots(2, 3, figsize=(14.0, 6.5), layout="constrained")
    flights: dict[tuple[str, str, str], Flight] = {}
    for row, aircraft in enumerate(AIRCRAFT):
        for column, scenario in enumerate(SCENARIOS):
            for what, more, color in (("", (), "C0"), ("off", ("off",), "C3"), ("loss30", ("loss30",), "C2")):
                flight, factor = fly(scenario, (*VARIANTS[aircraft], *more))
                flights[scenario, aircraft, what] = flight
                print(f"{scenario} {aircraft} {what}: {factor:.1f} x real time, {flight.verdict.word}", file=sys.stderr)
                if what == "loss30":
                    continue
                t, error = largest(flight, DRAWN[scenario].error)
                label = "without fault tolerance" if what else "with fault tolerance"
                axes[row][column].semilogy(t, np.maximum(error, 1e-4), color=color, label=label, linewidth=1.0)
            axis = axes[row][column]
            for at in sorted({at for at, _, kind, _ in flight.mission.events if kind == "warning"}):
                axis.axvline(at, color="gray", linewidth=0.7, linestyle=":")
            name = scenario.removeprefix("jsbsim_").replace("_", " ")
            axis.set(title=f"{name}, {aircraft}", xlabel="t, s", ylabel=DRAWN[scenario].label)
            axis.grid(alpha=0.3)
    axes[0][0].legend()
    figure.savefig(PICTURES / "jsbsim_aircraft.svg")
    print_claims(flights)


if __name__ == "__main__":
    main()
