"""Injects an elevator fault into UAV 3 by MAVSDK, and repairs it: ``python mavsdk_fault.py [PORT]``."""

import asyncio
import sys

from mavsdk import ComponentType, Configuration
from mavsdk.asyncio import Mavsdk
from mavsdk.asyncio.plugins.failure import FailureAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.plugins.failure.failure import FailureType, FailureUnit


async def main(port: int) -> None:
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
    systems = {}
    while 3 not in systems:
        await asyncio.sleep(0.1)
        systems = {await system.get_system_id(): system for system in await sdk.get_systems()}
    uav = systems[3]
    await ParamAsync(uav).set_param_float("FAIL_EFF", 0.7)
    await FailureAsync(uav).inject(FailureUnit.SYSTEM_SERVO, FailureType.WRONG, 2)
    print("elevator of UAV 3: effectiveness 0.7")
    await asyncio.sleep(5.0)
    await FailureAsync(uav).inject(FailureUnit.SYSTEM_SERVO, FailureType.OK, 2)
    print("repaired")


asyncio.run(main(int(sys.argv[1]) if len(sys.argv) > 1 else 14540))
