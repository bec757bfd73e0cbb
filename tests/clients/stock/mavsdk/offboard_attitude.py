"""Flies by attitude targets for some seconds."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.offboard import Attitude


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    action, offboard, telemetry = ActionAsync(drone), OffboardAsync(drone), TelemetryAsync(drone)

    print("-- Arming")
    await action.arm()

    async for angles in telemetry.subscribe_attitude_euler():
        roll, pitch, yaw = angles.roll_deg, angles.pitch_deg, angles.yaw_deg
        break
    print("-- Setting initial setpoint")
    await offboard.set_attitude(Attitude(roll, pitch, yaw, 0.5))
    print("-- Starting offboard")
    await offboard.start()

    print("-- Roll 8 degrees more")
    await offboard.set_attitude(Attitude(roll + 8.0, pitch, yaw, 0.5))
    async for angles in telemetry.subscribe_attitude_euler():
        if angles.roll_deg > roll + 4.0:
            print(f"-- Rolled to {angles.roll_deg:.1f}")
            break

    print("-- Stopping offboard")
    await offboard.stop()


asyncio.run(main())
