"""Sizes, limits, imports and prose of the workspace's Python; run by scripts/count and scripts/lint."""
