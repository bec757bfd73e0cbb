"""Prints whether it is armed, in the air and ready, and its flight mode."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    telemetry = TelemetryAsync(drone)

    print("Waiting for a global position estimate...")
    async for health in telemetry.subscribe_health():
        if health.is_global_position_ok and health.is_home_position_ok:
            print("Position estimate OK")
            break
    async for is_armed in telemetry.subscribe_armed():
        print("Is armed:", is_armed)
        break
    async for is_in_air in telemetry.subscribe_in_air():
        print("Is in air:", is_in_air)
        break
    async for flight_mode in telemetry.subscribe_flight_mode():
        print("FlightMode:", flight_mode.name)
        break
    async for home in telemetry.subscribe_home():
        print("Home:", home.latitude_deg, home.longitude_deg)
        break


asyncio.run(main())
