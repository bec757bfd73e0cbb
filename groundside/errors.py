"""What a user can get wrong: errors that are told in one message, without a traceback."""

from __future__ import annotations

__all__ = ["UserError"]


class UserError(ValueError):
    """Bad input; the text says what was wrong, where, and what would be right."""
