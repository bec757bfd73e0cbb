"""Prints what the autopilot says that it is."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.info import InfoAsync


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    print("System id:", await drone.get_system_id())
    info = InfoAsync(drone)
    version = await info.get_version()
    print(f"Version: {version.flight_sw_major}.{version.flight_sw_minor}.{version.flight_sw_patch}")
    print("Product:", (await info.get_product()).product_name)
    print("Identification:", (await info.get_identification()).legacy_uid)


asyncio.run(main())
