"""A swarm of twelve UAVs over three computers, in weather that networks are not made for."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ftcc.groundside import Run
from ftcc.groundside.report.links import network_section
from tests.hosts.conftest import FTCC, PORT, HostedFlight, clock_offsets
from tests.hosts.network import Host
from tests.hosts.wire import Weather
from tests.sitl.conftest import events, same_flight

Hosted = Callable[..., HostedFlight]
STATION = """
import socket, sys
from ftcc.link.codec import Codec
codec, heard = Codec(255, 190), set()
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
    station.bind(("", 14550))
    print("ready", flush=True)
    while len(heard) < int(sys.argv[1]):
        heard |= {message.get_srcSystem() for message in codec.parse(station.recv(4096))}
print(*sorted(heard))
"""
pytestmark = pytest.mark.timeout(600)  # the first start compiles

FLOOD = Path(__file__).with_name("flood.py")
MESH = 20007
"""Port of the first autopilot on each host: where nothing else runs, a block of ports begins at 20000."""
DEAD = 5.0
"""For how long a cable is out, wall s."""
SPEED = ("--speed", "1")
"""So that what happens in flight does."""


def test_bad_weather_and_a_dead_cable_change_no_bit(
    hosted: Hosted, hosts: list[Host], scenario: Path, keys: Path, tmp_path: Path
) -> None:
    """All is encrypted. On a fourth computer a ground station hears everybody, and a stranger calls without end."""
    station = hosts[3].run([sys.executable, "-c", STATION, "12"], stdout=subprocess.PIPE)
    assert station.stdout is not None
    assert station.stdout.readline() == "ready\n"
    asked = ("--duration", "4", "--seed", "5")
    flight = hosted(keys=keys)
    flight.start(scenario, *asked, *SPEED, "--mavlink", f"{hosts[3].address}:14550")
    flight.wait_until(lambda: "node b at" in flight.output())
    hosts[1].weather(Weather(delay=0.05, loss=0.1, reorder=0.1))
    flight.wait_until_flown(0.5)
    doors = [f"{hosts[0].address}:{PORT}", *(f"{host.address}:{MESH}" for host in hosts[:3])]
    flood = hosts[3].run([sys.executable, str(FLOOD), "10000", *doors], stdout=subprocess.PIPE)
    hosts[2].link_down()
    time.sleep(DEAD)
    hosts[2].link_up()
    flight.wait_until_flown(1.5)
    hosts[1].link_up()
    assert flight.wait() == 0, flight.everything()
    assert [flight.wait("b"), flight.wait("c")] == [0, 0], flight.everything()
    heard, _ = station.communicate(timeout=10.0)
    assert heard.split() == [str(uav) for uav in range(1, 13)]
    calls, _ = flood.communicate(timeout=60.0)
    assert calls.split()[:2] == ["10000", "0"], "nobody is let in"
    assert any("packets from unknown addresses dropped" in str(event["text"]) for event in events(flight.run))
    simulated = tmp_path / "simulated"
    subprocess.run([*FTCC, "simulate", str(scenario), *asked, "--out", str(simulated)], check=True)
    assert same_flight(flight.run, simulated)

    def longest_silence(sender: int, receiver: int) -> float:
        reports = flight.network()
        return max(one["silence"] for one in reports if (one["sender"], one["receiver"]) == (sender, receiver))

    assert longest_silence(7, 1) > DEAD - 1.0
    assert longest_silence(1, 7) > DEAD - 1.0
    assert sum(one["missing"] for one in flight.network()) == 0
    section = network_section(Run(flight.run).network)
    assert section.title == "Network between computers"
    shown = next(row for row in section.rows if [cell.text for cell in row[:2]] == ["UAV 7", "UAV 1"])
    assert f"{longest_silence(7, 1):.2f}" in [cell.text for cell in shown]


def test_lockstep_goes_on_without_a_computer_that_is_cut_off_and_one_that_is_killed(
    hosted: Hosted, hosts: list[Host], scenario: Path
) -> None:
    flight = hosted(timeout=2.0)
    flight.start(scenario, "--duration", "6", *SPEED, "--mavlink", "none")
    flight.wait_until_flown(0.5)
    hosts[2].link_down()
    cut = flight.wait_until(lambda: f"node c at {hosts[2].address} is gone" in flight.output())
    assert 1.0 < cut < 10.0  # after the plan's 2 s
    begun = max(one["t"] for one in flight.network())
    hosts[2].link_up()
    assert flight.wait("c") == 1
    # What it says first depends on which it finds out first: that it hears nobody, or, again connected, that it is out.
    gone = "(the leading computer is gone|the swarm flies on without this node, which it had lost); recorded in"
    assert re.search(gone, flight.output("c"))
    flight.wait_until_flown(begun + 0.5)
    hosts[1].kill_all()
    flight.wait_until(lambda: f"node b at {hosts[1].address} is gone" in flight.output())
    assert flight.wait() == 1, flight.everything()
    last = {uav: Run(flight.run).column("t", uav)[-1] for uav in (1, 2)}
    assert last == {1: 6.0, 2: 6.0}
    texts = [str(event["text"]) for event in events(flight.run)]
    for name, first, span in (("b", 3, "3-6"), ("c", 7, "7-10")):
        left = str(flight.part_of(name))
        assert any(left in text for text in texts)
        assert any(text.startswith(f"process uav{span}-vehicle died (node {name} at") for text in texts)
        assert Run(flight.part_of(name)).column("t", first)[-1] > 0.4
    flight.command("b", "report", str(flight.part_of("b")))


def test_on_the_wall_clock_neighbours_age_while_a_cable_is_out_and_come_back(
    hosted: Hosted, hosts: list[Host], scenario: Path
) -> None:
    flight = hosted()
    flight.start(scenario, "--duration", "6", "--clock", "wall", "--mavlink", "none")
    flight.wait_until_flown(1.0)
    hosts[2].link_down()
    time.sleep(1.5)
    hosts[2].link_up()
    assert flight.wait() == 0, flight.everything()
    assert [flight.wait("b"), flight.wait("c")] == [0, 0], flight.everything()
    offsets = clock_offsets(flight.output())
    assert len(offsets) == 2
    assert all(abs(offset) < 5.0 for offset in offsets)  # all hosts have the clock of this machine
    links = Run(flight.run).links
    edge = (links["uav"] == 1) & (links["sender"] == 10)
    oldest = dict(zip(links["t"][edge], links["oldest"][edge], strict=True))
    assert oldest[1.0] < 0.7
    assert np.nanmax(links["oldest"][edge]) > 1.0
    assert oldest[6.0] < 0.7
