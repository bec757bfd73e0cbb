"""Lists the root of the vehicle's files."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.ftp import FtpAsync


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    try:
        listing = await FtpAsync(drone).list_directory("/")
        print("Files:", [entry.name for entry in listing.files])
    except Exception as reason:
        print("No files:", reason)


asyncio.run(main())
