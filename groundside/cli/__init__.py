"""The command line ``ftcc``: a module per group of commands, put together in `app`."""

from ftcc.groundside.cli.app import app, main

__all__ = ["app", "main"]
