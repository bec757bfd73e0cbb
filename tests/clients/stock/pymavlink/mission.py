"""Downloads the mission with MAVLink's own loader, the fence and the rally points."""

import sys

from pymavlink import mavutil, mavwp

master = mavutil.mavlink_connection(sys.argv[1])
master.wait_heartbeat()

loader = mavwp.MAVWPLoader()
master.waypoint_request_list_send()
count = master.recv_match(type=["MISSION_COUNT"], blocking=True, timeout=20)
loader.expected_count = count.count
for sequence in range(count.count):
    master.waypoint_request_send(sequence)
    loader.add(master.recv_match(type=["MISSION_ITEM", "MISSION_ITEM_INT"], blocking=True, timeout=20))
print(f"Downloaded {loader.count()} waypoints")
for kind in (mavutil.mavlink.MAV_MISSION_TYPE_FENCE, mavutil.mavlink.MAV_MISSION_TYPE_RALLY):
    master.mav.mission_request_list_send(master.target_system, master.target_component, kind)
    count = master.recv_match(type=["MISSION_COUNT"], blocking=True, timeout=20)
    print(f"Type {count.mission_type}: {count.count} items")
master.mav.mission_count_send(master.target_system, master.target_component, 2, 0)
ack = master.recv_match(type="MISSION_ACK", blocking=True, timeout=20)
print("Upload:", mavutil.mavlink.enums["MAV_MISSION_RESULT"][ack.type].name)
