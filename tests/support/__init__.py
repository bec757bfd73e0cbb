"""Shared by several folders of tests: reading recordings, a swarm in one process, packages as pip installs them."""
