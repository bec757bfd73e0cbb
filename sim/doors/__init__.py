"""Doors: an aircraft of ours as the simulator of another autopilot, PX4 or ArduPilot."""
