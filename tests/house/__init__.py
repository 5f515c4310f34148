"""Sizes, limits, layers and words of the workspace's Python, by the standard library alone. Run by scripts/count."""
