"""Benchmarks that asv runs for each commit."""
