"""A swarm over several computers: who flies what where, and all that travels between them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
