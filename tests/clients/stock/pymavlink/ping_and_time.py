"""Finds the vehicle by PING, as for a link on which it does not speak unasked; asks what it is and what time it has."""

import sys
import time

from pymavlink import mavutil

master = mavutil.mavlink_connection(sys.argv[1])


def wait_conn():
    """Sends a ping to stabilise the connection, and waits for a response."""
    message = None
    while not message:
        master.mav.ping_send(int(time.time() * 1e6), 0, 0, 0)
        message = master.recv_match()
        time.sleep(0.5)


wait_conn()
master.wait_heartbeat()
print("Connected to system", master.target_system)

master.mav.command_long_send(
    master.target_system,
    master.target_component,
    mavutil.mavlink.MAV_CMD_REQUEST_MESSAGE,
    0,
    mavutil.mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    0,
    0,
    0,
    0,
    0,
    0,
)
version = master.recv_match(type="AUTOPILOT_VERSION", blocking=True, timeout=20)
print("Version:", version.flight_sw_version >> 24, version.flight_sw_version >> 16 & 0xFF)

sent = time.time_ns()
master.mav.timesync_send(0, sent)
answer = master.recv_match(type="TIMESYNC", condition=f"TIMESYNC.ts1=={sent}", blocking=True, timeout=20)
print("Time of the vehicle:", answer.tc1 / 1e9)
