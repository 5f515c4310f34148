"""Force plates: the driver node, wrench and centre of pressure, and emulated plates."""
