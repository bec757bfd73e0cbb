"""Active fault tolerance on board: what a UAV finds out about its own actuators, and what it does about it.

A stage of the tick, `diagnose`, between `hear` and `refer`, beneath every scheme. It sees what the autopilot sees:
telemetry, the command in force, the nominal model. What it believes of each actuator is a `Belief`, what it tells
others is a `Health`, see `beliefs`.
"""
