"""From scenario files to a `Mission`, which holds the spec of each process: find, merge, check."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
