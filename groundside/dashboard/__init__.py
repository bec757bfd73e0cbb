"""The live dashboard in Rerun: snapshots of the swarm, and what is drawn of them; a recorded run again."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
