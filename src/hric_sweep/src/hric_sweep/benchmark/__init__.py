"""Benchmark that ranks controllers over collaborative tasks, body sizes and seeds, by a fixed rule."""
