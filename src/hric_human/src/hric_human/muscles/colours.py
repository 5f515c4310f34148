"""Colours of activation, in reports and live: the same everywhere, so that runs can be compared by sight."""

from collections.abc import Sequence

import numpy as np

from hric_control.geometry import FloatArray

ACTIVATION_COLOURS = ((0.0, "#2b5fa8"), (0.1, "#35a79c"), (0.25, "#f2c14e"), (0.5, "#b3261e"))
"""Activation [1] and colour of each stop, straight between them; beyond the last one it stays. Tasks beside a robot are
below it nearly always (project default)."""
_STOPS = [value for value, _ in ACTIVATION_COLOURS]
_RGB = np.array([[int(text[k : k + 2], 16) / 255.0 for k in (1, 3, 5)] for _, text in ACTIVATION_COLOURS])


def colour(activation: Sequence[float]) -> FloatArray:
    """Red, green and blue from 0 to 1 of n activations, shape (n, 3)."""
    return np.stack([np.interp(activation, _STOPS, part) for part in _RGB.T], axis=1)
