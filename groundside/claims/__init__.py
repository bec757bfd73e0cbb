"""What a scenario claims of its flight: expressions over recorded columns, metrics over them, and whether they hold."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
