"""A whole flight in one process, in memory or recorded, bit for bit as with processes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
