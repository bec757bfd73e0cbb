"""Speaks MAVLink beneath the plugins: asks for a message, hears it."""

import asyncio
import json
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.plugins.mavlink_direct import MavlinkMessage


async def main():
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(sys.argv[1])
    drone = await mavsdk.first_autopilot(timeout_s=30.0)
    direct = MavlinkDirectAsync(drone)
    system = await drone.get_system_id()

    async def hear(name):
        async for message in direct.subscribe_message(name):
            print(f"{message.message_name} from {message.system_id}:", message.fields_json)
            return

    hearing = asyncio.create_task(hear("ATTITUDE_QUATERNION"))
    fields = {"target_system": system, "target_component": 1, "command": 512, "confirmation": 0, "param1": 31}
    fields |= {f"param{n}": 0 for n in range(2, 8)}
    await asyncio.sleep(0.5)
    await direct.send_message(
        MavlinkMessage(
            message_name="COMMAND_LONG",
            system_id=245,
            component_id=190,
            target_system_id=system,
            target_component_id=1,
            fields_json=json.dumps(fields),
        )
    )
    await hearing


asyncio.run(main())
