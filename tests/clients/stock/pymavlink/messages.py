"""Asks for streams in the old way and in the new, and prints what comes."""

import sys
import time

from pymavlink import mavutil

master = mavutil.mavlink_connection(sys.argv[1])
master.wait_heartbeat()

# The old way.
master.mav.request_data_stream_send(
    master.target_system, master.target_component, mavutil.mavlink.MAV_DATA_STREAM_ALL, 4, 1
)
for name in ("ATTITUDE", "GLOBAL_POSITION_INT", "VFR_HUD", "GPS_RAW_INT", "SYS_STATUS"):
    print(master.recv_match(type=name, blocking=True, timeout=20))


# The new way.
def request_message_interval(message_id, frequency_hz):
    master.mav.command_long_send(
        master.target_system,
        master.target_component,
        mavutil.mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        0,
        message_id,
        1e6 / frequency_hz,
        0,
        0,
        0,
        0,
        0,
    )


request_message_interval(mavutil.mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, 20)
ack = master.recv_match(type="COMMAND_ACK", blocking=True, timeout=20)
print("SET_MESSAGE_INTERVAL:", mavutil.mavlink.enums["MAV_RESULT"][ack.result].name)
until, count = time.time() + 20, 0
while count < 5 and time.time() < until:
    if master.recv_match(type="ATTITUDE_QUATERNION", blocking=True, timeout=1):
        count += 1
print(count, "quaternions")
