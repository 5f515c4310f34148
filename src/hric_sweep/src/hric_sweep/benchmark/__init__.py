"""Benchmark of controllers over collaborations, bodies and seeds, by stated rules."""
