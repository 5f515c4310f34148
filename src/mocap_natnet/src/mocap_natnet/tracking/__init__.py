"""From a frame of the stream to bodies and markers in the axes that are published."""
