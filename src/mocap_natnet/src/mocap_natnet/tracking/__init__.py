"""Conversion of a frame of the stream to bodies and markers in the published axes."""
