"""Draw snapshots of a swarm in Rerun, live or from a recorded run."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
