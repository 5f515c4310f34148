"""The nodes of a live experiment."""
