"""Window in a browser: arm, person and forces of a running system. The page needs nothing from other hosts."""
