"""Arms, waits until that is so, and wants to disarm."""

import sys

from pymavlink import mavutil

master = mavutil.mavlink_connection(sys.argv[1])
# On a link that was opened from this side the vehicle speaks once it has heard somebody.
master.mav.heartbeat_send(
    mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavutil.mavlink.MAV_STATE_ACTIVE
)
master.wait_heartbeat()


def arm(value):
    command = mavutil.mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    master.mav.command_long_send(master.target_system, master.target_component, command, 0, value, 0, 0, 0, 0, 0, 0)
    ack = master.recv_match(type="COMMAND_ACK", condition=f"COMMAND_ACK.command=={command}", blocking=True, timeout=20)
    return mavutil.mavlink.enums["MAV_RESULT"][ack.result].name


print("Arm:", arm(1))
print("Waiting for the vehicle to arm")
master.motors_armed_wait()
print("Armed!")
print("Disarm:", arm(0))
text = master.recv_match(type="STATUSTEXT", blocking=True, timeout=20)
print("Vehicle says:", text.text)
