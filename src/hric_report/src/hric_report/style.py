"""How figures look, on paper and on the page: the colours and strokes of all curves, and the sizes of a journal."""

from dataclasses import dataclass

SINGLE, DOUBLE = 85.0, 170.0
"""Widths of a figure in one column of a journal and in two [mm]: within what Elsevier, IEEE and Springer print."""
RESOLUTION = 300
"""Of pictures for print [dots per inch]."""
TYPE = 7.5
"""Size of the type in a figure of those widths; journals require 6 to 8 [pt]."""


@dataclass(frozen=True)
class Role:
    """A curve's look.

    Attributes:
        light, dark: colour on white and on a dark page.
        width: of the line; 0: none, its points are drawn [pt].
        dash: lengths of stroke and gap; empty: solid [widths of the line].
        opacity: 1: covers what lies below.
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
"""Of curves that differ by colour alone: light, dark."""
ROLES = {
    "measured": Role("#1f5fa8", "#7db4f0"),
    "setpoint": Role("#222222", "#e6e9ec", 0.9, (4.0, 2.0)),
    "desired": Role("#d98c1f", "#f0b45a", 2.0, opacity=0.7),
    "raw": Role("#d9a7a0", "#8f625b", 1.8),
    "other": Role(*ALIKE[1], dash=(5.0, 2.0)),
    "samples": Role("#d9a7a0", "#8f625b", 0.0),
    **{f"s{k}": Role(*pair) for k, pair in enumerate(ALIKE)},
}
"""By the role of a curve, `figure.Curve.role`."""
LIMIT = ("#b3261e", "#ff8a80")
"""Colour of bounds and of bands: light, dark."""
Stops = tuple[tuple[float, str], ...]
"""A scale of colours: value and colour of each stop, from 0 on; straight between them."""


def css() -> str:
    """The colours as variables of the page, light and dark."""
    colours = {**{name: (role.light, role.dark) for name, role in ROLES.items()}, "limit": LIMIT}
    light, dark = (" ".join(f"--{name}: {pair[k]};" for name, pair in colours.items()) for k in (0, 1))
    return f":root {{ {light} }}\n:root[data-theme=dark] {{ {dark} }}"
