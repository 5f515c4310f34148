"""Random robots for the converter's tests: trees with all joint types, and descriptions spoilt in one place."""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

TYPES = ("revolute", "continuous", "prismatic", "fixed", "planar", "floating")
ONE = TYPES[:3]


def text(values) -> str:
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))


def tensor(random: np.random.Generator, mass: float) -> dict[str, str]:
    """Return the inertia of a possible body: of random points that share the mass."""
    points = random.normal(size=(10, 3)) * random.uniform(0.02, 0.2, 3)
    points -= points.mean(axis=0)
    J = sum(mass / 10.0 * (p @ p * np.eye(3) - np.outer(p, p)) for p in points)
    return {
        name: repr(float(J["xyz".index(name[1]), "xyz".index(name[2])]))
        for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    }


def add_link(robot: Element, name: str, random: np.random.Generator) -> None:
    link = SubElement(robot, "link", name=name)
    inertial, mass = SubElement(link, "inertial"), float(random.uniform(0.1, 10.0))
    SubElement(inertial, "origin", xyz=text(random.uniform(-0.3, 0.3, 3)), rpy=text(random.uniform(-np.pi, np.pi, 3)))
    SubElement(inertial, "mass", value=repr(mass))
    SubElement(inertial, "inertia", tensor(random, mass))
    for purpose in ("visual", "collision"):
        geometry = SubElement(SubElement(link, purpose), "geometry")
        SubElement(geometry, "box", size=text(random.uniform(0.05, 0.2, 3)))


def add_joint(robot: Element, name: str, kind: str, parent: str, child: str, random: np.random.Generator) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    # Now and then a right angle, where body-fixed angles are singular.
    rpy = (
        random.uniform(-np.pi, np.pi, 3)
        if random.random() < 0.7
        else random.choice([0.0, np.pi / 2, -np.pi / 2, np.pi], 3)
    )
    SubElement(joint, "origin", xyz=text(random.uniform(-0.5, 0.5, 3)), rpy=text(rpy))
    if kind not in ("fixed", "floating"):
        axis = (
            random.normal(size=3)
            if random.random() < 0.7
            else random.permutation([0.0, 0.0, random.choice([-1.0, 1.0])])
        )
        SubElement(joint, "axis", xyz=text(axis))
    if kind in ONE:
        limit = (
            {}
            if kind == "continuous"
            else {"lower": repr(float(random.uniform(-2.0, 0.0))), "upper": repr(float(random.uniform(0.0, 2.0)))}
        )
        SubElement(joint, "limit", limit | {"effort": repr(float(random.uniform(1.0, 100.0))), "velocity": "2.0"})
        SubElement(
            joint,
            "dynamics",
            damping=repr(float(random.uniform(0.0, 5.0))),
            friction=repr(float(random.uniform(0.0, 2.0))),
        )
    return joint


def tree(seed: int, joints: int = 12) -> str:
    """A tree with every joint type, random axes and origins, and a mimic joint where two joints can be coupled."""
    random = np.random.default_rng(seed)
    robot = Element("robot", name=f"tree{seed}")
    add_link(robot, "link0", random)
    kinds = [*TYPES, *random.choice(TYPES, joints - len(TYPES))]
    coupled: Element | None = None
    for number, kind in enumerate(random.permutation(kinds), 1):
        add_link(robot, f"link{number}", random)
        parent = f"link{random.integers(max(0, number - 3), number)}"
        joint = add_joint(robot, f"joint{number}", str(kind), parent, f"link{number}", random)
        if kind in ONE and coupled is None:
            coupled = joint
        elif kind in ONE and coupled is not None and robot.find(".//mimic") is None:
            mimic = {
                "multiplier": repr(float(random.uniform(-2.0, 2.0))),
                "offset": repr(float(random.uniform(-0.5, 0.5))),
            }
            SubElement(joint, "mimic", {"joint": coupled.get("name", "")} | mimic)
    return ElementTree.tostring(robot, encoding="unicode")


BAD_VALUES = (
    "",
    "nan",
    "-1",
    "0",
    "0 0 0",
    "1e400",
    "1e-300",
    "x",
    "1 2",
    "no such thing",
    "a/b",
    "1 2 3 4",
    "-0.5",
    "1,5",
    "link1",
    "joint1",
    "\u00e9 *",
)


def spoilt(urdf_xml: str, seed: int) -> str:
    """The description with one thing spoilt: an attribute, an element, or the text itself."""
    random = np.random.default_rng(seed)
    root = ElementTree.fromstring(urdf_xml)
    pairs = [
        (parent, child) for parent in root.iter() for child in parent if child.tag not in ("transmission", "gazebo")
    ]
    parent, child = pairs[random.integers(len(pairs))]
    attributed = [element for element in root.iter() if element.attrib]
    kind = ("value", "value", "value", "value", "no attribute", "no element", "twice", "moved", "cut", "type")[
        seed % 10
    ]
    if kind in ("value", "no attribute"):
        element = attributed[random.integers(len(attributed))]
        name = str(random.choice(sorted(element.attrib)))
        if kind == "value":
            element.set(name, str(random.choice(BAD_VALUES)))
        else:
            del element.attrib[name]
    elif kind == "no element":
        parent.remove(child)
    elif kind == "twice":
        parent.append(child)
    elif kind == "moved":
        links, ends = root.findall("link"), [*root.iter("parent"), *root.iter("child")]
        ends[random.integers(len(ends))].set("link", links[random.integers(len(links))].get("name", ""))
    elif kind == "type":
        joints = root.findall("joint")
        joints[random.integers(len(joints))].set("type", str(random.choice([*TYPES, "screw", ""])))
    text = ElementTree.tostring(root, encoding="unicode")
    return text[: int(random.integers(len(text)))] if kind == "cut" else text
