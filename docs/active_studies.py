"""Compares active and passive fault tolerance: ``python docs/active_studies.py [--samples N] [SCENARIO ...]``.

For each chapter: a copy of the shipped scenario whose leader climbs in three steps, while a random follower loses a
random share of its thrust at a random time. It is flown with the own law told of the fault and the swarm making room,
with the law told alone, and with the law as it is, on the same draws. The scenario `active` is chapter 5's.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from ftcc.groundside.scenario import load, shipped

LEADERS = {"prescribed_performance": 4, "nearest_neighbour": 5, "finite_time_containment": 5}
"""By scenario, the leader that climbs."""

DIAGNOSIS = """

[diagnosis]
on = true
accommodate = true
cooperate = true

[variant.passive]
title = "the law as it is"
diagnosis = { on = false, accommodate = false, cooperate = false }

[variant.alone]
title = "the law is told of its fault, and the swarm makes no room"
diagnosis = { cooperate = false }
"""

STUDY = """[study]
against = ["alone", "passive"]

[study.changes]
disturbances = []
faults = [{{ at = 20.0, uav = 1, actuator = "thrust", effectiveness = 0.55, without_trim = true }}]
plant = {{ limits = {{ thrust = [0.0, 40.0] }} }}
noise = {{ V = 0.05, z = 0.1, gamma = 0.002, theta = 0.002, q = 0.005 }}
channel = {{ loss = 0.3 }}

[study.changes.leaders.{leader}]
altitude_filter = {{ frequency = 0.05, damping = 0.9 }}
commands = [{{ at = 15.0, altitude = 1100.0 }}, {{ at = 55.0, altitude = 1200.0 }}, {{ at = 95.0, altitude = 1300.0 }}]

[study.random]
faults.0.uav = {{ distribution = "choice", values = {followers} }}
faults.0.at = {{ distribution = "uniform", low = 16.0, high = 40.0 }}
faults.0.effectiveness = {{ distribution = "uniform", low = 0.42, high = 0.75 }}
plant.coefficients.CD0 = {{ distribution = "uniform", low = 0.9, high = 1.1 }}
plant.coefficients.Cmde = {{ distribution = "uniform", low = 0.8, high = 1.2 }}

[[study.claims]]            # the wing stalls at 18 m/s
name = "least airspeed"
metric = "min"
signal = "V"
window = [5.0, 120.0]
unit = "m/s"
bound = "> 18"
"""


def scenario_of(name: str, folder: Path) -> Path:
    """Write the copy of a scenario and its study into ``folder``."""
    file = folder / f"{name}.toml"
    file.write_text(shipped()[name].read_text(encoding="utf-8") + DIAGNOSIS, encoding="utf-8")
    study = STUDY.format(leader=LEADERS[name], followers=load(name).plan.uavs.followers)
    file.with_suffix(".study.toml").write_text(study, encoding="utf-8")
    return file


def main() -> None:
    """Write and fly."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenarios", nargs="*", default=[*LEADERS, "active"], metavar="SCENARIO")
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--out", type=Path, default=Path("studies/active"), help="folder of the studies")
    given = parser.parse_args()
    if unknown := [name for name in given.scenarios if name not in (*LEADERS, "active")]:
        parser.error(f"{', '.join(unknown)}: choose from {', '.join(LEADERS)}, active")
    given.out.mkdir(parents=True, exist_ok=True)
    for name in given.scenarios:
        scenario = name if name == "active" else str(scenario_of(name, given.out))
        options = ["--duration", "120", "--samples", str(given.samples), "--out", str(given.out / name)]
        subprocess.run([sys.executable, "-m", "ftcc.groundside.cli", "study", scenario, *options], check=True)


if __name__ == "__main__":
    main()
