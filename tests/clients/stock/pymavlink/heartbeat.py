"""Waits for a HEARTBEAT and says what it tells."""

import sys

from pymavlink import mavutil

master = mavutil.mavlink_connection(sys.argv[1])
master.wait_heartbeat()
print(f"Heartbeat from system {master.target_system} component {master.target_component}")
print("Mode:", master.flightmode)
print("Armed:", bool(master.motors_armed()))
print("Type:", mavutil.mavlink.enums["MAV_TYPE"][master.mav_type].name)
