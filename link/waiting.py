"""Why the compiled flight of a process goes back to Python: something has come, or is to be done, that is not a tick.

The ticks of a process are flown in one compiled function, which keeps all that it knows in arrays and can be called
again at any time. It returns one of these causes.
"""

from __future__ import annotations

__all__ = ["ATTEND", "DATAGRAM", "FLOWN", "GO_ON", "HELD", "MAIL", "WORK"]

GO_ON = 0
"""Nothing: the flight goes on."""
ATTEND = 1
"""Something else than a datagram between vehicle and autopilot can be read, or it is time to look around."""
DATAGRAM = 2
"""A datagram has come that is not of a tick, for the UAV ``wire.whose``."""
MAIL = 3
"""The mesh has something, which is needed now."""
WORK = 4
"""A tick was flown after which there is something to be done: to be put on the mesh, written, or told."""
HELD = 5
"""The next tick may not begin yet."""
FLOWN = 6
"""There is nothing left to fly."""
