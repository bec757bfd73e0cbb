"""Goes through the modes by their names, as pymavlink knows them for PX4."""

import sys
import time

from pymavlink import mavutil

master = mavutil.mavlink_connection(sys.argv[1])
# On a link that was opened from this side the vehicle speaks once it has heard somebody.
master.mav.heartbeat_send(
    mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavutil.mavlink.MAV_STATE_ACTIVE
)
master.wait_heartbeat()
print("Available modes:", sorted(master.mode_mapping()))

for mode in ("LOITER", "LOITER", "MISSION"):
    master.set_mode(mode)
    until = time.time() + 20
    while master.flightmode != mode and time.time() < until:
        master.recv_match(type="HEARTBEAT", blocking=True, timeout=1)
    print("Mode:", master.flightmode)
