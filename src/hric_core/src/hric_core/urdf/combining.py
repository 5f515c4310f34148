"""One description (URDF) of several robots that stand in one world."""

from collections.abc import Mapping
from xml.etree import ElementTree

from hric_core.errors import DescriptionError
from hric_core.urdf import elements
from hric_core.urdf.reading import read
from hric_core.urdf.robot import WORLD


def combined(name: str, descriptions: Mapping[str, str]) -> str:
    """Return one description of several robots; the robots' root links `world` become one.

    A robot whose root link has another name is fixed to the link `world`.

    Args:
        name: name of the combination.
        descriptions: URDF (xacro expanded) of each robot, by its name in messages.

    Raises:
        DescriptionError: a description is not usable, or two have a link, joint or transmission of the same name.
    """
    result = ElementTree.Element("robot", name=name)
    ElementTree.SubElement(result, "link", name=WORLD)
    owners: dict[tuple[str, str], str] = {}
    materials = set[str]()
    for owner, description in descriptions.items():
        root, document = read(description, owner).root, elements.parse(description)
        result.attrib.update({key: value for key, value in document.items() if key.startswith("xmlns")})
        if (version := document.get("version", elements.VERSIONS[0])) > result.get("version", elements.VERSIONS[0]):
            result.set("version", version)
        for element in document:
            parent = element.find("parent")
            if element.tag == "joint" and parent is not None and parent.get("link") == root == WORLD:
                element.set("name", f"{owner}_to_world_{element.get('name')}")
            label = element.get("name", "")
            if (element.tag == "link" and label == root == WORLD) or (element.tag == "material" and label in materials):
                continue
            first = owners.setdefault((element.tag, label), owner)
            if element.tag in ("link", "joint", "transmission") and first != owner:
                raise DescriptionError(
                    f"{first} and {owner} both have a {element.tag} {label}; valid: names that differ, such as those "
                    "of another arm_id"
                )
            materials.update([label] if element.tag == "material" else [])
            result.append(element)
        if root != WORLD:
            joint = ElementTree.SubElement(result, "joint", name=f"{owner}_to_world", type="fixed")
            ElementTree.SubElement(joint, "parent", link=WORLD)
            ElementTree.SubElement(joint, "child", link=root)
    return ElementTree.tostring(result, encoding="unicode")
