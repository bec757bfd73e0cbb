"""Lets the navigation solution fail, and repairs it."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.failure import FailureAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.plugins.failure import FailureType, FailureUnit


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    param, failure = ParamAsync(drone), FailureAsync(drone)

    print("-- Enabling failure injection")
    await param.set_param_int("SYS_FAILURE_EN", 1)
    print("-- Injecting GPS failure")
    await failure.inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0)
    await asyncio.sleep(2)
    print("-- Repairing it")
    await failure.inject(FailureUnit.SENSOR_GPS, FailureType.OK, 0)
    print("-- Injecting a battery failure, where there is no battery")
    try:
        await failure.inject(FailureUnit.SYSTEM_BATTERY, FailureType.OFF, 0)
    except Exception as reason:
        print("-- Refused:", reason)


asyncio.run(main())
