"""Our aircraft for JSBSim: an airframe sheet written as an aircraft that JSBSim flies."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
