"""Our airframe sheets as aircraft for JSBSim, and JSBSim's aircraft as airframe sheets."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
