"""Robot descriptions for the conformance tests: small test robots, and robots of PyPI's example-robot-data."""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

INERTIAL = (
    '<inertial><origin xyz="0.02 -0.01 -0.2" rpy="0.1 0.2 0.3"/><mass value="{}"/>'
    '<inertia ixx="0.011" iyy="0.012" izz="0.013" ixy="0.001" ixz="0" iyz="-0.001"/></inertial>'
)
LIMIT = '<limit lower="-1" upper="1" effort="50" velocity="5"/>'
BASE = '<link name="base"/>'


def link(name: str, mass: float = 1.0, inside: str = "") -> str:
    """Return the URDF of a link with a mass [kg]."""
    return f'<link name="{name}">{INERTIAL.format(mass)}{inside}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = "") -> str:
    """Return the URDF of a joint about or along y, with a small offset from its parent."""
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="0.1 0.2 -0.1" rpy="0.2 0 0.1"/><axis xyz="0 1 0"/>'
        f'<parent link="{parent}"/><child link="{child}"/>{inside if kind == "fixed" else LIMIT + inside}</joint>'
    )


def mimic(leader: str, multiplier: float, offset: float = 0.0) -> str:
    """Return the URDF element of a mimic law."""
    return f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'


def robot(*parts: str) -> str:
    """Return the URDF of a robot with these elements."""
    return f'<robot name="r">{"".join(parts)}</robot>'


def ball(x: float, radius: float) -> str:
    """Return the URDF of a collision sphere on the x axis [m]."""
    return f'<collision><origin xyz="{x} 0 0"/><geometry><sphere radius="{radius}"/></geometry></collision>'


MIMICS = {
    "side by side": robot(
        BASE, link("a"), link("b", 0.7), joint("lead", "base", "a"),
        joint("follow", "base", "b", inside=mimic("lead", -1.0, 0.1)),
    ),
    "one behind the other": robot(
        BASE, link("a"), link("b", 0.7), joint("lead", "base", "a"),
        joint("follow", "a", "b", inside=mimic("lead", 1.5, -0.2)),
    ),
    "leader further out": robot(
        BASE, link("a"), link("b", 0.7), joint("follow", "base", "a", inside=mimic("lead", -0.5)),
        joint("lead", "a", "b"),
    ),
    "follower of a follower": robot(
        BASE, link("a"), link("b", 0.7), link("c", 0.3),
        joint("last", "a", "c", inside=mimic("follow", 2.0, 0.05)),
        joint("follow", "base", "b", inside=mimic("lead", -0.4, 0.1)), joint("lead", "base", "a"),
    ),
    "multiplier 0": robot(
        BASE, link("a"), link("b", 0.7), joint("lead", "base", "a"),
        joint("follow", "a", "b", inside=mimic("lead", 0.0, 0.3)),
    ),
    "rack and pinion": robot(
        BASE, link("a"), link("b", 0.7), joint("lead", "base", "a"),
        joint("follow", "base", "b", "prismatic", inside=mimic("lead", 0.05, 0.1)),
    ),
    "passive leader": robot(
        BASE, link("arm", 2.0), link("a", 0.4), link("b", 0.3), joint("drive", "base", "arm"),
        joint("lead", "arm", "a"), joint("follow", "arm", "b", inside=mimic("lead", -1.0, 0.1)),
    ),
}  # fmt: skip
"""Robots with mimic laws of every kind, by name; the leader is the joint `lead`."""
CHAINS = {
    "prismatic": robot(
        BASE, link("a"), link("b", 0.7), joint("slide", "base", "a", "prismatic"), joint("turn", "a", "b"),
    ),
    "continuous": robot(
        BASE, link("a"), link("b", 0.7), joint("spin", "base", "a", "continuous"),
        joint("wheel", "a", "b", "continuous"),
    ),
    "branched": robot(
        BASE, link("a"), link("b", 0.7), link("c", 0.5), link("plate", 0.2), joint("one", "base", "a"),
        joint("two", "a", "b"), joint("three", "a", "plate", "fixed"), joint("four", "plate", "c"),
    ),
    "four-bar, cut": robot(
        BASE, link("crank", 0.5), link("coupler"), link("rocker", 0.7), joint("first", "base", "crank"),
        joint("second", "crank", "coupler"), joint("third", "base", "rocker"),
    ),
}  # fmt: skip
BAR = (
    '<inertial><origin xyz="0.15 0 0"/><mass value="1"/>'
    '<inertia ixx="0.001" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def parallelogram(*laws: str) -> str:
    """Return the URDF of a parallelogram: two cranks of 0.3 m, 0.4 m apart, and a coupler on the first.

    Args:
        laws: mimic laws of the coupler and of the second crank.
    """

    def axle(name: str, x: float, parent: str, child: str, law: str = "") -> str:
        return (
            f'<joint name="{name}" type="continuous"><origin xyz="{x} 0 0"/><axis xyz="0 1 0"/>'
            f'<parent link="{parent}"/><child link="{child}"/>{law}</joint>'
        )

    coupler, second = laws or ("", "")
    return robot(
        BASE, *(f'<link name="{name}">{BAR}</link>' for name in ("crank", "coupler", "rocker")),
        axle("first", 0.0, "base", "crank"), axle("second", 0.3, "crank", "coupler", coupler),
        axle("third", 0.4, "base", "rocker", second),
    )  # fmt: skip


CONTACTS = {
    "plate below the first link": (
        robot(
            BASE, link("plate", 1.0, ball(0.0, 0.2)), joint("hold", "base", "plate", "fixed"),
            link("a", 1.0, ball(0.1, 0.2)), joint("turn", "base", "a"),
        ),
        set(),
    ),
    "flange over two fixed joints, jaw": (
        robot(
            BASE, link("arm", 1.0, ball(0.0, 0.2)), joint("turn", "base", "arm"),
            link("adapter", 0.1), joint("hold", "arm", "adapter", "fixed"),
            link("flange", 0.5, ball(0.0, 0.2)), joint("screw", "adapter", "flange", "fixed"),
            link("jaw", 0.3, ball(0.0, 0.2)), joint("bite", "adapter", "jaw"),
            link("pad", 0.1, ball(0.0, 0.2)), joint("glue", "jaw", "pad", "fixed"),
        ),
        set(),
    ),
    "links with one between them": (
        robot(
            BASE, link("a", 1.0, ball(0.0, 0.4)), joint("one", "base", "a"),
            link("b"), joint("two", "a", "b"),
            link("c", 0.7, ball(0.0, 0.4)), joint("three", "b", "c"),
        ),
        {("a", "c")},
    ),
    "siblings": (
        robot(
            BASE, link("a", 1.0, ball(0.0, 0.2)), joint("one", "base", "a"),
            link("b", 0.7, ball(0.0, 0.2)), joint("two", "base", "b"),
        ),
        {("a", "b")},
    ),
}  # fmt: skip
"""Robots with overlapping links, and the pairs that collide: those separated by more than one moving joint."""

PUBLIC = (
    "a1.urdf",
    "allegro_left_hand.urdf",
    "anymal-kinova.urdf",
    "double_pendulum_continuous.urdf",
    "g1_29dof_with_hand_rev_1_0.urdf",
    "kinova.urdf",
    "panda_collision.urdf",
    "pr2.urdf",
    "romeo_small.urdf",
    "so100.urdf",
    "solo12.urdf",
    "ur5_robot.urdf",
    "xarm7.urdf",
    "z1.urdf",
)
"""File names of public robots: arms, hands, legged robots, humanoids; some with mimic or prismatic joints."""


def without_losses(urdf: str) -> str:
    """Return a description without damping and friction."""
    return re.sub(r"<dynamics[^>]*/>", "", urdf)


def public_folder() -> Path:
    """Return the data folder of the installed package."""
    places = (Path(entry) / "cmeel.prefix/share/example-robot-data" for entry in sys.path)
    return next(place for place in places if place.is_dir())


def public(name: str) -> str:
    """Return a public description by its file name."""
    (path,) = public_folder().rglob(name)
    return path.read_text(encoding="utf-8")


@contextmanager
def public_package(folder: Path) -> Iterator[None]:
    """Provide the data as a ROS package under the name in its mesh addresses; its package.xml has another name.

    Args:
        folder: empty folder for the package.
    """
    package = folder / "example-robot-data"
    package.mkdir()
    (package / "robots").symlink_to(public_folder() / "robots")
    (package / "package.xml").write_text("<package><name>example-robot-data</name></package>", encoding="utf-8")
    before = os.environ.get("ROS_PACKAGE_PATH", "")
    os.environ["ROS_PACKAGE_PATH"] = f"{before}{os.pathsep}{folder}"
    try:
        yield
    finally:
        os.environ["ROS_PACKAGE_PATH"] = before
