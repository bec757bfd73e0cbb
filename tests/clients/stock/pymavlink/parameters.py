"""Reads all parameters, reads one, writes it, reads it again."""

import sys

from pymavlink import mavutil

master = mavutil.mavlink_connection(sys.argv[1])
# On a link that was opened from this side the vehicle speaks once it has heard somebody.
master.mav.heartbeat_send(
    mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavutil.mavlink.MAV_STATE_ACTIVE
)
master.wait_heartbeat()

master.mav.param_request_list_send(master.target_system, master.target_component)
names = set()
while True:
    message = master.recv_match(type="PARAM_VALUE", blocking=True, timeout=5)
    if message is None:
        break
    names.add(message.param_id)
    if len(names) == message.param_count:
        break
print(f"{len(names)} of {message.param_count if message else '?'} parameters")


def read():
    master.mav.param_request_read_send(master.target_system, master.target_component, b"COM_OF_LOSS_T", -1)
    message = master.recv_match(type="PARAM_VALUE", blocking=True, timeout=20)
    print(f"name: {message.param_id}\tvalue: {message.param_value}")


read()
master.mav.param_set_send(
    master.target_system, master.target_component, b"COM_OF_LOSS_T", 3.5, mavutil.mavlink.MAV_PARAM_TYPE_REAL32
)
message = master.recv_match(type="PARAM_VALUE", blocking=True, timeout=20)
print(f"name: {message.param_id}\tvalue: {message.param_value}")
read()
