"""Reads all parameters, then reads, sets and reads again a float and an integer."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.param import ParamAsync


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    param = ParamAsync(drone)

    everything = await param.get_all_params()
    for one in [*everything.int_params, *everything.float_params]:
        print(f"{one.name}: {one.value}")

    await param.set_param_float("COM_OF_LOSS_T", 2.5)
    print("COM_OF_LOSS_T is now", await param.get_param_float("COM_OF_LOSS_T"))
    await param.set_param_float("COM_OF_LOSS_T", 1.0)
    await param.set_param_int("SYS_FAILURE_EN", 1)
    print("SYS_FAILURE_EN is now", await param.get_param_int("SYS_FAILURE_EN"))
    try:
        await param.get_param_float("NO_SUCH_PARAM")
    except Exception as reason:
        print("NO_SUCH_PARAM:", reason)


asyncio.run(main())
