"""Prints battery, GNSS, whether it flies and where, as they come."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync


async def show(label, values, count=3):
    async for value in values:
        print(f"{label}: {value}")
        count -= 1
        if count == 0:
            return


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    telemetry = TelemetryAsync(drone)
    await asyncio.gather(
        show("Battery", telemetry.subscribe_battery()),
        show("GPS info", telemetry.subscribe_gps_info()),
        show("In air", telemetry.subscribe_in_air()),
        show("Position", telemetry.subscribe_position()),
    )


asyncio.run(main())
