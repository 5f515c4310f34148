"""Conversion of a mocap frame to bodies and markers in the published axes."""
