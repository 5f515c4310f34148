"""HTML page of a sweep: `build` writes it, and each other module computes a part of it."""
