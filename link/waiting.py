"""The causes for which the compiled flight of a process returns to Python.

One compiled function flies the ticks of a process. Its whole state is in arrays, so it can be called again at any time.
It returns one of these causes.
"""

from __future__ import annotations

__all__ = ["ATTEND", "DATAGRAM", "FLOWN", "GO_ON", "HELD", "MAIL", "WORK"]

GO_ON = 0
"""Nothing: the flight goes on."""
ATTEND = 1
"""A descriptor other than those between vehicle and autopilot is readable, or it is time to check the launcher."""
DATAGRAM = 2
"""A datagram has arrived for the UAV ``wire.whose`` that compiled code does not read."""
MAIL = 3
"""A transmission has arrived on the mesh, and is needed now."""
WORK = 4
"""A tick is flown after which Python has work: a transmission, rows to write, events to report."""
HELD = 5
"""The gate holds the next tick."""
FLOWN = 6
"""The flight is over."""
