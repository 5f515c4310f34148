"""Page of a sweep, each part in a module of its own; `build` writes it."""
