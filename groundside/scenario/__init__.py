"""From scenario files to what every process is told: finding, merging, checking, and the `Mission` that results."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
