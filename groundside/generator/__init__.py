"""Scenarios made from one line: swarms of any scheme, size and graph, flown before they are handed over."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
