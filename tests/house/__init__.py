"""Sizes, limits, imports and words of the workspace's Python; run by scripts/count and scripts/lint."""
