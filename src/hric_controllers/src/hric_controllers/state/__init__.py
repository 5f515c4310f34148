"""Controllers that publish states."""
