"""Checks of code sizes, imports and texts of the workspace, for scripts/count and scripts/lint."""
