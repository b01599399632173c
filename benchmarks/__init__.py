"""Benchmarks: figures of speed and accuracy beside a peer or a limit, in the same run."""
