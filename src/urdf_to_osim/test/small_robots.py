"""Small descriptions, written by hand, for the converter's tests."""

BODY = (
    '<inertial><origin xyz="0.1 0.2 0.3"/><mass value="2"/><inertia ixx="0.1" ixy="0.01" ixz="0.02" '
    'iyy="0.12" iyz="0.03" izz="0.15"/></inertial>'
)
LIMIT = '<limit lower="-1" upper="2" effort="30" velocity="1"/>'


def link(name: str, inside: str = BODY) -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, kind: str, parent: str, child: str, inside: str = LIMIT) -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def robot(*parts: str, name: str = "small") -> str:
    return f'<robot name="{name}">{"".join(parts)}</robot>'


def one_joint(kind: str = "revolute", inside: str = LIMIT, child: str = BODY) -> str:
    """A base without mass and one joint, `swing`, that moves link `arm`."""
    return robot(link("base", ""), link("arm", child), joint("swing", kind, "base", "arm", inside))


def gripper(mimic: str = '<mimic joint="left" multiplier="-2" offset="0.1"/>') -> str:
    """Two sliding fingers, `left` and `right`, of which the second mimics the first."""
    return robot(
        link("palm"),
        link("finger1"),
        link("finger2"),
        joint("left", "prismatic", "palm", "finger1"),
        joint("right", "prismatic", "palm", "finger2", LIMIT + mimic),
    )
