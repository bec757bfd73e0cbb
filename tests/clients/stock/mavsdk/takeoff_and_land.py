"""Arms, takes off, watches, wants to land."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    action, telemetry = ActionAsync(drone), TelemetryAsync(drone)

    async for health in telemetry.subscribe_health():
        if health.is_global_position_ok and health.is_home_position_ok:
            print("-- Global position estimate OK")
            break

    print("-- Arming")
    await action.arm()
    print("-- Taking off")
    await action.takeoff()

    await asyncio.sleep(2)
    async for position in telemetry.subscribe_position():
        print(f"-- Flying at {position.relative_altitude_m:.1f} m")
        break

    print("-- Landing")
    try:
        await action.land()
    except Exception as reason:
        print(f"-- Not landed: {reason}")


asyncio.run(main())
