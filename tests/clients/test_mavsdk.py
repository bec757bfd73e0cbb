"""MAVSDK, unchanged, with a swarm on one port: it finds everybody, hears, sets, injects and flies offboard."""

from __future__ import annotations

import asyncio
import math
import subprocess
import sys
import time
from collections.abc import AsyncGenerator, Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest

from ftcc.groundside import Run
from tests.clients.conftest import Swarm

mavsdk = pytest.importorskip("mavsdk", reason="MAVSDK is not installed (extra dev)")

from mavsdk.asyncio import Mavsdk  # noqa: E402
from mavsdk.asyncio.plugins.failure import FailureAsync  # noqa: E402
from mavsdk.asyncio.plugins.offboard import OffboardAsync  # noqa: E402
from mavsdk.asyncio.plugins.param import ParamAsync  # noqa: E402
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync  # noqa: E402
from mavsdk.plugins.failure.failure import FailureType, FailureUnit  # noqa: E402
from mavsdk.plugins.offboard.offboard import Attitude  # noqa: E402
from mavsdk.plugins.telemetry.telemetry import FlightMode  # noqa: E402

PATIENCE = 30.0
"""Wall time for anything to come, s."""

Run_ = Callable[[Coroutine[Any, Any, Any]], Any]


class Client:
    """MAVSDK on a port, and its systems by id."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        kind = mavsdk.ComponentType.GROUND_STATION
        self.sdk = Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
        self.systems: dict[int, Any] = {}

    def run(self, what: Coroutine[Any, Any, Any]) -> Any:
        """The result of a coroutine."""
        return self.loop.run_until_complete(asyncio.wait_for(what, PATIENCE))

    async def find(self, port: int, count: int) -> None:
        await self.sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        while await self.sdk.system_count() < count:
            await asyncio.sleep(0.05)
        for system in await self.sdk.get_systems():
            self.systems[await system.get_system_id()] = system


@pytest.fixture(scope="module")
def client(swarm: Swarm) -> Iterator[Client]:
    one = Client()
    one.run(one.find(swarm.offboard, 4))
    yield one
    one.run(one.sdk.destroy()) if asyncio.iscoroutinefunction(one.sdk.destroy) else one.sdk.destroy()
    one.loop.close()


async def first(values: AsyncGenerator[Any, None], wanted: Callable[[Any], bool] = lambda _: True) -> Any:
    """The first value that is as wanted."""
    async for value in values:
        if wanted(value):
            return value
    raise AssertionError("the stream has ended")


def test_it_finds_every_vehicle_on_one_port(client: Client) -> None:
    assert sorted(client.systems) == [1, 2, 3, 4]


def test_it_receives_position_velocity_attitude_metrics_health_and_mode(client: Client) -> None:
    for system in client.systems.values():
        telemetry = TelemetryAsync(system)
        position = client.run(first(telemetry.subscribe_position()))
        assert 900.0 < position.relative_altitude_m < 1100.0
        velocity = client.run(first(telemetry.subscribe_velocity_ned()))
        assert 15.0 < velocity.north_m_s < 45.0
        attitude = client.run(first(telemetry.subscribe_attitude_euler()))
        assert abs(attitude.roll_deg) < 20.0
        metrics = client.run(first(telemetry.subscribe_fixedwing_metrics(), lambda m: m.airspeed_m_s > 0.0))
        assert metrics.airspeed_m_s == pytest.approx(math.hypot(velocity.north_m_s, velocity.down_m_s), abs=5.0)
        client.run(
            first(
                telemetry.subscribe_health(),
                lambda h: h.is_home_position_ok and h.is_global_position_ok and h.is_local_position_ok,
            )
        )
        assert client.run(first(telemetry.subscribe_flight_mode())) == FlightMode.MISSION
        assert client.run(first(telemetry.subscribe_in_air()))


def test_it_sets_and_reads_parameters_integers_and_floats(client: Client) -> None:
    parameters = ParamAsync(client.systems[2])
    client.run(parameters.set_param_int("FTCC_AT", 59_000))
    assert client.run(parameters.get_param_int("FTCC_AT")) == 59_000
    client.run(parameters.set_param_int("FTCC_AT", 0))
    client.run(parameters.set_param_float("FAIL_EFF", 0.75))
    assert client.run(parameters.get_param_float("FAIL_EFF")) == 0.75
    assert client.run(parameters.get_param_int("SYS_FAILURE_EN")) == 1
    everything = client.run(parameters.get_all_params())
    assert len(everything.float_params) > 40


def test_it_injects_and_repairs_an_elevator_fault(client: Client, swarm: Swarm) -> None:
    """And its effectiveness in the recording changes within 0.2 s of simulated time."""
    system = client.systems[3]
    telemetry, failure = TelemetryAsync(system), FailureAsync(system)
    client.run(ParamAsync(system).set_param_float("FAIL_EFF", 0.9))

    def now() -> float:
        return client.run(first(telemetry.subscribe_attitude_euler())).timestamp_us / 1e6  # type: ignore[no-any-return]

    before = now()
    client.run(failure.inject(FailureUnit.SYSTEM_SERVO, FailureType.WRONG, 2))
    injected = now()
    time.sleep(1.0)
    client.run(failure.inject(FailureUnit.SYSTEM_SERVO, FailureType.OK, 2))
    repaired = now()
    time.sleep(3.0)
    run = Run(swarm.flight.folder)
    t, effectiveness = run.column("t", 3), run.column("elevator_effectiveness", 3)
    changes = t[1:][effectiveness[1:] != effectiveness[:-1]]
    assert set(effectiveness) == {1.0, 0.9}
    assert len(changes) == 2
    assert before <= changes[0] <= injected + 0.2
    assert injected <= changes[1] <= repaired + 0.2


def test_the_program_of_the_tutorial_injects_a_fault_and_repairs_it(swarm: Swarm) -> None:
    program = Path(__file__).parents[2] / "docs" / "tutorials" / "mavsdk_fault.py"
    command = [sys.executable, str(program), str(swarm.station)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert ended.returncode == 0, ended.stderr
    assert "repaired" in ended.stdout
    assert 0.7 in Run(swarm.flight.folder).column("elevator_effectiveness", 3)


def test_it_sets_an_attitude_target_through_offboard(client: Client) -> None:
    system = client.systems[4]
    telemetry, offboard = TelemetryAsync(system), OffboardAsync(system)
    start = client.run(first(telemetry.subscribe_attitude_euler()))
    target = Attitude(start.roll_deg + 8.0, start.pitch_deg, start.yaw_deg, 0.5)
    client.run(offboard.set_attitude(target))
    client.run(offboard.start())
    assert client.run(first(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.OFFBOARD))
    rolled = client.run(
        first(telemetry.subscribe_attitude_euler(), lambda angles: angles.roll_deg > start.roll_deg + 4.0)
    )
    assert rolled.roll_deg < start.roll_deg + 20.0
    client.run(offboard.stop())
    assert client.run(first(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD))
