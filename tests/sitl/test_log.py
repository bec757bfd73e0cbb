"""The log of a flight, read by other people's tools."""

from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink import mavutil

from tests.sitl.conftest import Flight

GPX = {"gpx": "http://www.topografix.com/GPX/1/0"}
TRACK = ("GLOBAL_POSITION_INT", "GPS_RAW_INT", "VFR_HUD", "ATTITUDE", "SERVO_OUTPUT_RAW")


def tool(name: str, *arguments: str) -> str:
    """What one of pymavlink's own tools prints."""
    script = Path(sys.executable).with_name(name)
    return subprocess.run(
        [sys.executable, str(script), *arguments], capture_output=True, text=True, check=True, timeout=60
    ).stdout


@pytest.mark.parametrize("speed", ["5", "max"])
def test_tools_find_the_track_of_every_uav(speed: str, fly: Callable[..., Flight]) -> None:
    seconds = 10
    flight = fly("containment", "--speed", speed, "--duration", str(seconds), "--mavlink", "none")
    assert flight.wait() == 0, flight.output
    log = flight.folder / "telemetry.tlog"

    read = mavutil.mavlink_connection(str(log))
    counted: Counter[tuple[int, str]] = Counter()
    stamps = []
    while (message := read.recv_match()) is not None:
        assert message.get_type() != "BAD_DATA"
        counted[message.get_srcSystem(), message.get_type()] += 1
        stamps.append(message._timestamp)
    assert stamps == sorted(stamps)
    assert stamps[-1] - stamps[0] == pytest.approx(seconds, abs=0.2)
    for uav in range(1, 9):
        assert counted[uav, "HEARTBEAT"] >= 1
        assert all(counted[uav, kind] >= 1 for kind in TRACK), counted
        assert read.sysid_state[uav].mav_type == mavutil.mavlink.MAV_TYPE_FIXED_WING

    for uav in (3, 8):
        only = f"HEARTBEAT.get_srcSystem()=={uav}"
        tool("mavtogpx.py", "--condition", only, "--type", "GLOBAL_POSITION_INT", "--", str(log))
        points = ET.parse(f"{log}.gpx").findall(".//gpx:trkpt", GPX)
        assert len(points) == counted[uav, "GLOBAL_POSITION_INT"] >= seconds // 2
        # 30 m/s northwards.
        north = [(float(point.get("lat", "nan")) - 47.3977) * 111_319.5 for point in points]
        assert north[-1] - north[0] == pytest.approx(30.0 * seconds, rel=0.25)
    assert "GPS_RAW_INT" in tool("mavlogdump.py", "--types", "GPS_RAW_INT", "--source-system", "2", str(log))
