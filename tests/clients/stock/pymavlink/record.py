"""Records what comes for some seconds, as a log that every MAVLink tool reads."""

import sys
import time

from pymavlink import mavutil

master = mavutil.mavlink_connection(sys.argv[1])
master.setup_logfile(sys.argv[2])
master.wait_heartbeat()
until, count = time.time() + 6, 0
while time.time() < until:
    if master.recv_match(blocking=True, timeout=1):
        count += 1
print(count, "messages")
