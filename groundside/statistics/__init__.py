"""What studies compute with: random quantities, designs of draws, intervals, stopping rules, sensitivity indices."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
