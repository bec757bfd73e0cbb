"""Report a run: on the terminal, as JSON, and as a page with figures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
