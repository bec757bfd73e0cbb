"""The hosts and wires that the other tests here fly on: what is asserted of a swarm must not be due to them."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.hosts.network import Host, Network
from tests.hosts.wire import Weather

ECHO = """
import socket
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as echo:
    echo.bind(("", 9000))
    print("ready", flush=True)
    while True:
        data, sender = echo.recvfrom(2000)
        echo.sendto(data, sender)
"""
ASK = """
import socket, sys, time
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ask:
    ask.connect((sys.argv[1], 9000))
    ask.settimeout(float(sys.argv[3]))
    for number in range(int(sys.argv[2])):
        ask.send(f"{number} {time.monotonic()}".encode())
        time.sleep(0.0005)  # buffers of sockets are small
    try:
        while True:
            number, sent = ask.recv(2000).split()
            print(int(number), time.monotonic() - float(sent))
    except (TimeoutError, ConnectionRefusedError):
        pass
"""


@pytest.fixture(scope="module")
def pair() -> Iterator[list[Host]]:
    with Network(2) as hosts:
        hosts[1].lay_wire()
        echo = hosts[1].run([sys.executable, "-c", ECHO], stdout=subprocess.PIPE)
        assert echo.stdout is not None
        assert echo.stdout.readline() == "ready\n"
        yield hosts
    echo.communicate()


def asked(hosts: list[Host], count: int = 1, patience: float = 0.3) -> list[tuple[int, float]]:
    """Numbers that came back to host a from host b, as they came, and the seconds that each took."""
    command = [sys.executable, "-c", ASK, hosts[1].address, str(count), str(patience)]
    output, _ = hosts[0].run(command, stdout=subprocess.PIPE).communicate(timeout=20)
    return [(int(number), float(seconds)) for number, seconds in map(str.split, output.splitlines())]


def test_hosts_reach_each_other_and_nobody_else(pair: list[Host]) -> None:
    assert [number for number, _ in asked(pair, 20)] == list(range(20))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.settimeout(0.2)
        here.bind(("127.0.0.1", 0))
        say = f"import socket; socket.socket(2, 2).sendto(b'x', ('127.0.0.1', {here.getsockname()[1]}))"
        assert pair[0].run([sys.executable, "-c", say]).wait() == 0
        with pytest.raises(TimeoutError):
            here.recv(1)


def test_a_cable_that_is_out_is_only_silent(pair: list[Host]) -> None:
    pair[1].link_down()
    assert asked(pair, 5) == []
    assert pair[1]._space.call("cat /sys/class/net/eth0/carrier").strip() == "1"
    pair[1].link_up()
    assert len(asked(pair, 5)) == 5


def test_frames_are_late_lost_and_overtaken_as_often_as_the_weather_says(pair: list[Host]) -> None:
    pair[1].weather(Weather(delay=0.1, loss=0.1, reorder=0.2))
    came = asked(pair, 400, 1.0)
    pair[1].link_up()
    back = [number for number, _ in came]
    # There and back: 0.81 of 400; four standard deviations are 31.
    assert 324 - 31 <= len(back) <= 324 + 31
    assert len(set(back)) == len(back)
    assert back != sorted(back)
    waited = [seconds for _, seconds in came]
    assert max(waited) >= 0.2
    assert min(waited) < 0.2  # overtook at least one way


def test_a_host_that_is_killed_leaves_no_process_and_keeps_its_network(pair: list[Host]) -> None:
    with Network(1) as (host,):
        busy = host.run(["sh", "-c", "sleep 100 & sleep 100"])
        while len(host.processes()) < 3:
            time.sleep(0.01)
        host.kill_all()
        assert busy.wait(5) != 0
        assert host.processes() == []
        assert host.run(["true"]).wait() == 0


def test_the_end_of_the_program_is_the_end_of_its_hosts() -> None:
    """By SIGKILL, so that nothing is left to clean up."""
    program = """
import time
from tests.hosts.network import Network
hosts = Network(2).hosts
hosts[0].lay_wire()
sleeper = hosts[0].run(["sleep", "100"])
while not hosts[0].processes():
    time.sleep(0.01)
print(*hosts[0].processes(), hosts[0]._space.first, flush=True)
time.sleep(100)
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2]
    )
    assert process.stdout is not None
    pids = [int(pid) for pid in process.stdout.readline().split()]
    assert len(pids) >= 2
    process.kill()
    process.communicate()
    until = time.monotonic() + 10.0
    while any(Path(f"/proc/{pid}").exists() for pid in pids):
        assert time.monotonic() < until
        time.sleep(0.02)
