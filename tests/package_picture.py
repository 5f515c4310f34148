"""Draw the packages and their imports for docs/architecture.md: python3 tests/package_picture.py --write.

The picture is made from the imports in the code; tests/test_architecture.py checks that the file is up to date.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path

from house import imports

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "packages.svg"
HOUSES = {
    "core": (
        *("hric_core", "hric_dynamics", "hric_control", "hric_controllers", "controller_manager", "panda_description"),
        *("xacro", "franka_hw_interface", "franka_sim", "franka_real", "ur_robot", "urdf_to_osim"),
        *("pybullet_ros_control", "opensim_ros_control", "mujoco_ros_control"),
    ),
    "human": (
        *("hric_human", "hric_motion", "hric_skin", "hric_assessment", "hric_supervisor"),
        *("hric_perception", "mocap_natnet"),
    ),
    "lab": (
        *("hric_bags", "hric_run", "hric_analysis", "hric_report", "hric_sweep", "hric_measurements"),
        *("hric_view", "hric_experiments", "hric_gym"),
    ),
}
"""Python packages of each group (core, human, lab); scripts are in no group."""
LOOKS = {"core": ("#e3ecf7", 0.0, 1.0), "human": ("#f9e8dc", 0.0, 0.55), "lab": ("#e3f2e6", 0.55, 1.0)}
"""Colours of each group, and its left and right edge as a share of the width of the picture [1]."""
WIDTH, ROW, BOX, HEIGHT, GAP = 1000.0, 56.0, 152.0, 28.0, 8.0
"""Width of the picture, distance of rows, width and height of a package, and margin of a group [px]."""
Graph = Mapping[str, frozenset[str]]
"""Imported packages by name of the importing package."""


def imported() -> Graph:
    """Return the packages that each package imports.

    Raises:
        ValueError: a package is in no group.
    """
    graph = imports.graph(ROOT)
    known = {name for names in HOUSES.values() for name in names}
    if strange := set(graph) - known:
        raise ValueError(f"no house has {', '.join(sorted(strange))}: add it to HOUSES of tests/package_picture.py")
    return {name: graph.get(name, frozenset()) for name in known}


def below(graph: Graph, name: str) -> frozenset[str]:
    """Return all packages that a package imports, directly or through others."""
    return graph[name].union(*(below(graph, other) for other in graph[name]))


def direct(graph: Graph, name: str) -> list[str]:
    """Return the packages that a package imports directly, without those that are also imported through another one."""
    return sorted(graph[name].difference(*(below(graph, other) for other in graph[name])))


def places(graph: Graph) -> dict[str, tuple[float, float]]:
    """Return the centre of each package [px]: above all packages that it imports; human and lab above the core."""
    people = {*HOUSES["human"], *HOUSES["lab"]}
    core = [name for name in HOUSES["core"] if not people & below(graph, name)]  # MuJoCo's camera draws a person's skin
    row = {name: 0 for name in graph}
    for _ in graph:
        floor = max(row[name] for name in core) + 1
        for name in graph:
            row[name] = max((row[other] + 1 for other in graph[name]), default=0)
            row[name] = row[name] if name in core else max(row[name], floor)
    top = max(row.values())
    placed = {}
    for house, (_, begin, end) in LOOKS.items():
        for level in range(top + 1):
            names = sorted(name for name in HOUSES[house] if row[name] == level)
            for k, name in enumerate(names):
                x = WIDTH * (begin + (end - begin) * (k + 0.5) / len(names))
                placed[name] = (x, ROW * (top - level + 0.8) + (0.6 * ROW if house == "core" else 0.0))
    return placed


def picture(graph: Graph) -> str:
    """Return the picture as SVG."""
    at = places(graph)
    height = max(y for _, y in at.values()) + ROW
    parts = [_house(house, [at[name][1] for name in names]) for house, names in HOUSES.items()]
    parts += [_import(*at[name], *at[other]) for name in sorted(graph) for other in direct(graph, name)]
    parts += [_package(name, *at[name]) for name in sorted(graph)]
    size = f'width="{WIDTH:.0f}" height="{height:.0f}" viewBox="0 0 {WIDTH:.0f} {height:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="13">'
    return "\n".join([head, '<rect width="100%" height="100%" fill="white"/>', *parts, "</svg>\n"])


def _house(name: str, heights: list[float]) -> str:
    colour, begin, end = LOOKS[name]
    x, top = WIDTH * begin + GAP, min(heights) - 0.7 * ROW
    size = f'width="{WIDTH * (end - begin) - 2 * GAP:.0f}" height="{max(heights) + 0.55 * ROW - top:.0f}"'
    return (
        f'<rect x="{x:.0f}" y="{top:.0f}" {size} rx="10" fill="{colour}"/>'
        f'<text x="{x + 10:.0f}" y="{top + 20:.0f}" font-weight="bold" font-size="16">{name}</text>'
    )


def _import(x: float, y: float, other_x: float, other_y: float) -> str:
    begin, end = y + 0.5 * HEIGHT, other_y - 0.5 * HEIGHT
    middle = 0.5 * (begin + end)
    path = f"M{x:.0f} {begin:.0f}C{x:.0f} {middle:.0f} {other_x:.0f} {middle:.0f} {other_x:.0f} {end:.0f}"
    return f'<path d="{path}" fill="none" stroke="#66707a" stroke-width="1.4"/>'


def _package(name: str, x: float, y: float) -> str:
    corner = f'x="{x - 0.5 * BOX:.0f}" y="{y - 0.5 * HEIGHT:.0f}"'
    return (
        f'<rect {corner} width="{BOX:.0f}" height="{HEIGHT:.0f}" rx="5" fill="white" stroke="#39424c"/>'
        f'<text x="{x:.0f}" y="{y + 4:.0f}" text-anchor="middle">{name}</text>'
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", required=True, help="write the file of the picture")
    parser.parse_args()
    PICTURE.write_text(picture(imported()))
