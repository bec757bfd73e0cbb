"""Records what comes for some seconds, as a log that every MAVLink tool reads."""

import struct
import sys
import time

from pymavlink import mavutil

master = mavutil.mavlink_connection(sys.argv[1])
master.wait_heartbeat()
until, count = time.time() + 6, 0
with open(sys.argv[2], "wb") as log:
    while time.time() < until:
        message = master.recv_match(blocking=True, timeout=1)
        if message is not None and message.get_type() != "BAD_DATA":
            log.write(struct.pack(">Q", int(time.time() * 1e6)) + message.get_msgbuf())
            count += 1
print(count, "messages")
