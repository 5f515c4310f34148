"""Electromyography (EMG): the driver node, the signal envelope, and emulated muscles."""
