"""MAVProxy, unchanged, driven by what a user types; it lives in an environment of its own, see ``.ci/run``."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import threading
import time
from pathlib import Path

import pytest

from tests.clients.conftest import Swarm

PROGRAM = os.environ.get("FTCC_MAVPROXY") or shutil.which("mavproxy.py")

pytestmark = pytest.mark.skipif(
    PROGRAM is None or not Path(PROGRAM).exists(),
    reason="MAVProxy is not installed; FTCC_MAVPROXY names its mavproxy.py (.ci/run makes an environment for it)",
)


class MavProxy:
    """A MAVProxy whose terminal is ours."""

    def __init__(self, port: int, folder: Path) -> None:
        self.text = ""
        assert PROGRAM is not None
        self._process = subprocess.Popen(
            [str(Path(PROGRAM).with_name("python")), PROGRAM, f"--master=udpin:127.0.0.1:{port}", "--nowait"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env={**os.environ, "HOME": str(folder), "PYTHONUNBUFFERED": "1"},
            text=True,
            bufsize=1,
        )
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        while character := self._process.stdout.read(1):
            self.text += character

    def wait_for(self, pattern: str, begin: int = 0, seconds: float = 60.0) -> re.Match[str]:
        """Wait until the output from ``begin`` on shows a pattern."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            found = re.search(pattern, self.text[begin:])
            if found:
                return found
            time.sleep(0.05)
        raise AssertionError(f"waited in vain for {pattern!r}:\n{self.text}")

    def type(self, line: str, answer: str) -> re.Match[str]:
        """Type a line and wait for its answer; typed again after a while, as a user would."""
        begin = len(self.text)
        assert self._process.stdin is not None
        for _ in range(4):
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
            try:
                return self.wait_for(answer, begin, 10.0)
            except AssertionError:
                continue
        return self.wait_for(answer, begin, 1.0)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()


def test_a_session(swarm: Swarm, tmp_path: Path) -> None:
    """Link, parameter list and set, injection, mode, vehicle switch, status."""
    proxy = MavProxy(swarm.station, tmp_path)
    try:
        for uav in range(1, 5):
            proxy.wait_for(f"vehicle {uav}:1 on link")
        listed = int(proxy.wait_for(r"Received (\d+) parameters").group(1))
        assert listed > 60
        proxy.type("link", r"link 1 OK .* 0 lost")
        proxy.type("param set FAIL_EFF 0.95\nparam show FAIL_EFF", r"FAIL_EFF\s+0\.9[45]")
        proxy.type("long 420 102 4 2 0 0 0 0", "INJECT_FAILURE: ACCEPTED")
        proxy.wait_for("elevator wrong: eff 0.95")
        proxy.type("long 420 102 0 2 0 0 0 0", "elevator repaired")
        proxy.type("long 420 100 1 1 0 0 0 0", "INJECT_FAILURE: UNSUPPORTED")
        proxy.type("long 176 129 4 3 0 0 0 0", "DO_SET_MODE: ACCEPTED")
        proxy.wait_for("Mode LOITER")
        proxy.type("long 176 129 4 4 0 0 0 0", "DO_SET_MODE: ACCEPTED")
        proxy.type("vehicle 2", "Set vehicle 2")
        position = proxy.type("status GLOBAL_POSITION_INT", r"GLOBAL_POSITION_INT {[^}]*relative_alt : (\d+)")
        assert 800_000 < int(position.group(1)) < 1_200_000
    finally:
        proxy.close()


def test_what_a_user_types_at_any_vehicle(swarm: Swarm, tmp_path: Path) -> None:
    """Arming, disarming, take-off, plans, files, logs, ping, speed: each is answered."""
    proxy = MavProxy(swarm.offboard, tmp_path)
    try:
        for uav in range(1, 5):
            proxy.wait_for(f"vehicle {uav}:1 on link")
        proxy.type("vehicle 3", "Set vehicle 3")
        proxy.type("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED")
        proxy.type("disarm", "COMPONENT_ARM_DISARM: DENIED")
        proxy.wait_for("AP: in the air")
        proxy.type("takeoff 100", "NAV_TAKEOFF: ACCEPTED")
        proxy.type("mode", "Available modes: .*LOITER.*MISSION")
        proxy.type("long DO_SET_MODE 129 4 3", "DO_SET_MODE: ACCEPTED")
        proxy.wait_for("Mode LOITER")
        proxy.type("long DO_SET_MODE 129 4 4", "DO_SET_MODE: ACCEPTED")
        proxy.type("long DO_SET_MODE 129 4 5", "DO_SET_MODE: DENIED")
        proxy.type("wp list", "Requesting 0 waypoints")
        proxy.type("fence list", "Requesting 0 fence items")
        proxy.type("rally list", "Requesting 0 rally items")
        proxy.type("ftp list /", "Listing /")
        proxy.type("log list", "No logs")
        proxy.type("ping", "ping response: .* from=3/1")
        proxy.type("setspeed 25", "DO_CHANGE_SPEED: DENIED")
        proxy.type("param fetch COM_OF_LOSS_T", r"COM_OF_LOSS_T = \d")
        proxy.type("reboot", "PREFLIGHT_REBOOT_SHUTDOWN: DENIED")
    finally:
        proxy.close()
