"""The flight of the synthetic swarm, drawn once."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.groundside.dashboard.recorded import DURATION, make
from tests.groundside.dashboard.synthetic_swarm import flight


@pytest.fixture(scope="package")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "swarm.rrd"
    dashboard = make(path)
    for snap in flight(DURATION):
        dashboard.log(snap)
    dashboard.close()
    assert dashboard.address is None
    assert dashboard.take_problems() == ()
    return path
