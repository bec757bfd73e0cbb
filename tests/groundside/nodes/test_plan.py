"""Which computer flies what: read, and refused with a word on what would be right."""

from __future__ import annotations

from pathlib import Path

import pytest

from ftcc.groundside.nodes import NodesError, NodesPlan, read_plan
from ftcc.groundside.text import ids_of

GOOD = """
listen = "127.0.0.1:7447"
[[nodes]]
name = "a"
uavs = "1-3"
[[nodes]]
name = "b"
vehicles = "5"
autopilots = [4, 5, 6]
"""


def plan(tmp_path: Path, text: str) -> NodesPlan:
    path = tmp_path / "nodes.toml"
    path.write_text(text)
    return read_plan(path)


def test_every_uav_has_its_place(tmp_path: Path) -> None:
    read = plan(tmp_path, GOOD)
    assert [read.vehicle_at(uav) for uav in range(1, 8)] == ["a", "a", "a", "", "b", "", ""]
    assert [read.autopilot_at(uav) for uav in range(1, 8)] == ["a", "a", "a", "b", "b", "b", ""]
    with pytest.raises(NodesError, match=r"node b: there is no UAV 6; the swarm has 1-5"):
        read.require_in(range(1, 6))


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("listen", "hear", "listen: Field required"),
        ("127.0.0.1:7447", "127.0.0.1", "listen: must be HOST:PORT"),
        ('"1-3"', '"1-"', "nodes.0.uavs: '1-': must be ids of UAVs such as 1-6, 8"),
        ('"1-3"', '"3-1"', "nodes.0.uavs: '3-1': must be ids"),
        ('"1-3"', '"1-5"', "the vehicle of UAV 5 is there twice"),
        ("[4, 5, 6]", "[3, 4]", "the autopilot of UAV 3 is there twice"),
        ('name = "b"', 'name = "a"', "name a is there twice"),
        ('name = "b"', 'name = "lead"', "nodes.1.name: must be letters, digits, - and _, and not 'lead'"),
        ('uavs = "1-3"', "", "nodes.0: needs uavs, vehicles or autopilots"),
        ("[[nodes]]", "timeout = 0.1\n[[nodes]]", "timeout: Input should be greater than or equal to 2"),
        ('"1-3"', '"1-3', "Illegal character"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, said: str, tmp_path: Path) -> None:
    assert before in GOOD
    with pytest.raises(NodesError) as refused:
        plan(tmp_path, GOOD.replace(before, after, 1))
    assert said in str(refused.value)
    assert str(tmp_path / "nodes.toml") in str(refused.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(NodesError, match=r"--nodes .*nodes.toml: No such file"):
        read_plan(tmp_path / "nodes.toml")


def test_ids_as_they_are_written() -> None:
    assert ids_of("1-4, 8,6") == (1, 2, 3, 4, 6, 8)
