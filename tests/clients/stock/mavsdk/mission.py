"""Downloads the mission, starts it, pauses it, starts it again."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    mission, raw, telemetry = MissionAsync(drone), MissionRawAsync(drone), TelemetryAsync(drone)

    async def wait_for(name):
        async for mode in telemetry.subscribe_flight_mode():
            if mode.name == name:
                print("-- Mode", name)
                return

    items = await raw.download_mission()
    print(f"-- Downloaded {len(items)} items")
    print("-- Pausing mission")
    await mission.pause_mission()
    await wait_for("HOLD")
    print("-- Starting mission")
    await mission.start_mission()
    await wait_for("MISSION")


asyncio.run(main())
