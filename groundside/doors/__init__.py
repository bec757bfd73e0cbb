"""Flights of a scenario's aircraft by another autopilot: PX4 or ArduPilot."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
