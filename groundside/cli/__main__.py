"""``python -m ftcc.groundside.cli``."""

from ftcc.groundside.cli.app import main

main()
