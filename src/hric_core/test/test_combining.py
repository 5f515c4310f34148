"""Several robots in one description: one world, the names of each robot, and which links belong to which arm."""

import pytest

from hric_core.errors import DescriptionError
from hric_core.urdf import read
from hric_core.urdf.combining import combined


def arm(name: str, root: str = "world", material: str = "white") -> str:
    """Return an arm of two moving links on a fixed base."""
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    limit = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="5" velocity="2"/>'
    base = f"{name}_base"
    links = "".join(f'<link name="{name}_{link}">{mass}</link>' for link in ("base", "one", "two"))
    return (
        f'<robot name="{name}" version="1.1"><material name="{material}"/><link name="{root}"/>{links}'
        f'<joint name="mount" type="fixed"><origin xyz="0 {len(name)} 0"/><parent link="{root}"/><child link="{base}"/>'
        f'</joint><joint name="{name}_1" type="revolute"><parent link="{base}"/><child link="{name}_one"/>{limit}'
        f'</joint><joint name="{name}_2" type="revolute"><parent link="{name}_one"/><child link="{name}_two"/>{limit}'
        "</joint></robot>"
    )


def test_arms_share_the_world_and_keep_their_places_and_names() -> None:
    robot = read(combined("arms", {"l": arm("l"), "right": arm("right")}))
    assert (robot.name, robot.root) == ("arms", "world")
    assert [name for name, joint in robot.joints.items() if joint.type == "revolute"] == [
        "l_1",
        "l_2",
        "right_1",
        "right_2",
    ]
    poses = robot.poses({})
    assert (poses["l_base"][1, 3], poses["right_base"][1, 3]) == (1.0, 5.0)


def test_a_robot_with_another_root_stands_at_the_origin_of_the_world() -> None:
    robot = read(combined("arms", {"l": arm("l"), "r": arm("r", root="r_foot")}))
    assert robot.poses({})["r_foot"][:3, 3].tolist() == [0.0, 0.0, 0.0]


def test_two_robots_with_a_link_of_the_same_name_are_refused_by_name() -> None:
    with pytest.raises(DescriptionError, match="first and second both have a link l_base; valid: names that differ"):
        combined("arms", {"first": arm("l"), "second": arm("l")})


def test_links_of_two_arms_are_apart_and_no_neighbours_but_their_bases_are() -> None:
    robot = read(combined("arms", {"l": arm("l"), "r": arm("r")}))
    assert robot.apart("l_two", "r_one") and robot.apart("l_one", "r_base") and not robot.apart("l_one", "l_two")
    pairs = robot.neighbours()
    assert frozenset(("l_one", "l_two")) in pairs and frozenset(("l_base", "r_base")) in pairs
    assert frozenset(("l_one", "r_base")) not in pairs and frozenset(("l_one", "r_one")) not in pairs


def test_one_arm_alone_is_never_apart_from_itself() -> None:
    robot = read(arm("l"))
    assert robot.arms() == {} and not robot.apart("l_base", "l_two")
