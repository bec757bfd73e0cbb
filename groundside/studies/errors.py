"""The error of a study that cannot start."""

from __future__ import annotations

from ftcc.groundside.errors import UserError

__all__ = ["StudyError"]


class StudyError(UserError):
    """A study that cannot start, or go on."""
