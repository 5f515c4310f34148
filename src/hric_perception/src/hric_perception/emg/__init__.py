"""Electromyography: the driver node, the envelope, and emulated muscles."""
