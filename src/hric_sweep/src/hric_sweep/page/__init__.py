"""Page of a sweep, written by `build`, with one module per part."""
