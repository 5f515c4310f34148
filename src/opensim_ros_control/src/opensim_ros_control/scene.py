"""Combination of the robot's URDF and those of the models around it into one URDF."""

from collections.abc import Sequence
from copy import deepcopy
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from hric_control.plants import Model
from hric_core.urdf import read, write_origin
from hric_core.urdf.elements import VERSIONS, parse


def together(robot_xml: str, models: Sequence[Model]) -> str:
    """Return one URDF of the robot and the models; links and joints of the models are named "model::name".

    All models are attached to the robot's root link, which represents the world: a free model by a floating joint
    "model::free", a fixed one by a fixed joint "model::fixed".
    """
    if not models:
        return robot_xml
    robot = parse(robot_xml)
    robot.set("version", VERSIONS[-1])
    root = read(robot_xml).root
    for model in models:
        for element in parse(model.xml):
            if element.tag in ("link", "joint"):
                robot.append(_renamed(element, model.name))
        kind = ("fixed", f"{model.name}::fixed") if model.fixed else ("floating", model.free_joint)
        joint = SubElement(robot, "joint", type=kind[0], name=kind[1])
        SubElement(joint, "parent", link=root)
        SubElement(joint, "child", link=f"{model.name}::{model.tree.root}")
        write_origin(joint, model.T_world_origin)
    return ElementTree.tostring(robot, encoding="unicode")


def _renamed(element: Element, model: str) -> Element:
    copy = deepcopy(element)
    copy.set("name", f"{model}::{copy.get('name', '')}")
    for tag, attribute in (("parent", "link"), ("child", "link"), ("mimic", "joint")):
        for part in copy.findall(tag):
            part.set(attribute, f"{model}::{part.get(attribute, '')}")
    for visual in copy.findall("visual"):
        for material in visual.findall("material"):
            visual.remove(material)  # it may refer to a material that is defined outside the link
    return copy
