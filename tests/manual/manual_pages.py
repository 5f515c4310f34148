"""Which pages of the manual have commands that are tried."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TRIED = ("README.md", "docs/tutorials/*.md", "docs/howto/*.md")
SHORT = ("docs/howto/salvage_a_bag.md",)
"""Pages that are tried in every run of the tests: headless, a few seconds."""


def names() -> list[str]:
    """Of all pages with steps, from the workspace's root."""
    return sorted(str(path.relative_to(ROOT)) for pattern in TRIED for path in ROOT.glob(pattern))
