"""Style of figures in print and on HTML pages: colours and strokes of all curves, and sizes for journals."""

from dataclasses import dataclass

SINGLE, DOUBLE = 85.0, 170.0
"""Figure widths for one and for two journal columns, within the limits of Elsevier, IEEE and Springer [mm]."""
RESOLUTION = 300
"""Resolution of pictures for print [dots per inch]."""
TYPE = 7.5
"""Font size in figures for print [pt]; journals require 6 to 8."""


@dataclass(frozen=True)
class Role:
    """Appearance of a curve.

    Attributes:
        light, dark: colours on a white and on a dark page.
        width: line width [pt]; 0: points without a line.
        dash: lengths of dash and gap, as multiples of the line width; empty: solid.
        opacity: opacity from 0 to 1 (opaque).
    """

    light: str
    dark: str
    width: float = 1.0
    dash: tuple[float, ...] = ()
    opacity: float = 1.0


ALIKE = (
    ("#1f5fa8", "#7db4f0"),
    ("#d9601f", "#ff9a66"),
    ("#2c8c4a", "#7ad69a"),
    ("#8a4fb5", "#c79bec"),
    ("#a86f1f", "#e0b060"),
    ("#c23b7a", "#f58fbb"),
    ("#1c8f96", "#66cdd3"),
    ("#6b7280", "#a9b2bc"),
    ("#7d8f1a", "#c3d45c"),
    ("#4a4fd0", "#a3a7ff"),
)
"""Colours (on a light page, on a dark page) of similar curves s0, s1, ..., which differ only in colour."""
ROLES = {
    "measured": Role("#1f5fa8", "#7db4f0"),
    "setpoint": Role("#222222", "#e6e9ec", 0.9, (4.0, 2.0)),
    "desired": Role("#d98c1f", "#f0b45a", 2.0, opacity=0.7),
    "raw": Role("#d9a7a0", "#8f625b", 1.8),
    "other": Role(*ALIKE[1], dash=(5.0, 2.0)),
    "samples": Role("#d9a7a0", "#8f625b", 0.0),
    **{f"s{k}": Role(*pair) for k, pair in enumerate(ALIKE)},
}
"""Appearance of curves by their role (`figure.Curve.role`)."""
LIMIT = ("#b3261e", "#ff8a80")
"""Colours (on a light page, on a dark page) of limits and of marked time spans."""
Stops = tuple[tuple[float, str], ...]
"""Type of a colour scale: pairs of value and colour, from value 0 on, interpolated linearly."""


def css() -> str:
    """Return CSS that defines the colours as variables of an HTML page, for light and dark theme."""
    colours = {**{name: (role.light, role.dark) for name, role in ROLES.items()}, "limit": LIMIT}
    light, dark = (" ".join(f"--{name}: {pair[k]};" for name, pair in colours.items()) for k in (0, 1))
    return f":root {{ {light} }}\n:root[data-theme=dark] {{ {dark} }}"
