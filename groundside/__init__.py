"""What people touch; each room's `__init__.pyi` lists what the others use of it.

`simulate` flies a scenario in this process and `Swarm` with processes; `load` and `resolve` prepare one; `Run` opens a
recorded flight and `export` writes it for other programs; `Station` commands a running swarm. Each is imported
on its first use: a process of a swarm, or ``ftcc list``, must not pay for pydantic and Arrow.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
