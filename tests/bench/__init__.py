"""Benchmarks: they print, they do not assert. ``python -m tests.bench``"""
