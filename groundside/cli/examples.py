"""One example of each command, with which its help ends."""

from __future__ import annotations

__all__ = ["EXAMPLES"]

EXAMPLES = {
    "ftcc": "ftcc fly demo",
    "ftcc list": "ftcc list",
    "ftcc check": "ftcc check containment --variant loss30",
    "ftcc simulate": "ftcc simulate containment --variant off --set channel.delay=0.02",
    "ftcc verify": "ftcc verify containment --case flight+off --all",
    "ftcc study": "ftcc study containment --vary channel.loss=0,.1,.3 --seeds 20",
    "ftcc map": "ftcc map demo --x faults.0.effectiveness=.1:1:9 --y faults.0.bias=-.5:.5:9",
    "ftcc search": "ftcc search demo --over 'channel.loss=uniform(low=0, high=.9)'",
    "ftcc airframe": "ftcc airframe --airspeed 25 --airspeed 30 --coefficient CLde=1.1",
    "ftcc fly": "ftcc fly containment --speed 5 --viewer none --duration 60",
    "ftcc ps": "ftcc ps",
    "ftcc stop": "ftcc stop --all",
    "ftcc watch": "ftcc watch --no-browser",
    "ftcc doctor": "ftcc doctor containment --speed 10",
    "ftcc report": "ftcc report runs/demo-20260101-120000 --csv signals.csv --kml tracks.kml",
    "ftcc compare": "ftcc compare runs/with runs/without --out runs/compared",
    "ftcc replay": "ftcc replay runs/demo-20260101-120000 --viewer native",
    "ftcc vehicles": "ftcc vehicles",
    "ftcc fault": "ftcc fault 1 elevator --effectiveness 0.7 --bias 0.2 --at 60",
    "ftcc repair": "ftcc repair 1 elevator",
    "ftcc failures": "ftcc failures containment --variant sixdof",
    "ftcc commands": "ftcc commands",
    "ftcc link": "ftcc link cut 2",
    "ftcc link cut": "ftcc link cut 2 4 --at 60",
    "ftcc link restore": "ftcc link restore 2",
    "ftcc link degrade": "ftcc link degrade 3 4 --loss 0.5 --delay 0.1",
    "ftcc ftc": "ftcc ftc 3 off",
    "ftcc leader": "ftcc leader 7 --altitude 1100",
    "ftcc attitude": "ftcc attitude 2 --bank 10 --alpha 5",
    "ftcc mode": "ftcc mode 2 hold",
    "ftcc param": "ftcc param list 1",
    "ftcc param get": "ftcc param get 1 k11",
    "ftcc param set": "ftcc param set 1 k11 3.5",
    "ftcc param list": "ftcc param list 1",
    "ftcc pause": "ftcc pause",
    "ftcc step": "ftcc step 100",
    "ftcc resume": "ftcc resume",
    "ftcc speed": "ftcc speed max",
    "ftcc keys": "ftcc keys new",
    "ftcc keys new": "ftcc keys new swarm.key",
}
"""By the path of the command."""
