"""Reading a robot description: XML with errors that name the element."""

from __future__ import annotations

import math
from xml.etree import ElementTree

from hric_control.errors import DescriptionError


def parse(urdf_xml: str) -> ElementTree.Element:
    """The `<robot>` element.

    Raises:
        DescriptionError: not XML, or another root element.
    """
    try:
        root = ElementTree.fromstring(urdf_xml)
    except ElementTree.ParseError as error:
        raise DescriptionError(f"the robot description is not XML: {error}") from error
    if root.tag != "robot":
        raise DescriptionError(f"the robot description starts with <{root.tag}>; it must be <robot> (a .xacro file must be expanded first)")
    return root


def number(element: ElementTree.Element, attribute: str, where: str, default: float | None = None) -> float:
    """A finite number in an attribute.

    Args:
        element: the element that carries it.
        attribute: its name.
        where: what the element belongs to, for the error, e.g. "joint panda_joint1".
        default: value if the attribute is absent; None makes it required.

    Raises:
        DescriptionError: absent without a default, or not a finite number.
    """
    text = element.get(attribute)
    if text is None:
        if default is None:
            raise DescriptionError(f"{where}: <{element.tag}> has no {attribute}")
        return default
    return as_number(text, f"{where}: {attribute} of <{element.tag}>")


def as_number(text: str, where: str) -> float:
    """`text` as a finite number.

    Raises:
        DescriptionError: it is not one; the message begins with `where`.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DescriptionError(f"{where} must be a finite number; got {text!r}")
    return value


def joints(root: ElementTree.Element) -> dict[str, ElementTree.Element]:
    """The joints of the robot by name (those that are children of `<robot>`, not the mentions in transmissions)."""
    return {joint.get("name", ""): joint for joint in root.findall("joint")}


def root_link(root: ElementTree.Element) -> str:
    """The link that is nobody's child.

    Raises:
        DescriptionError: none, or more than one.
    """
    children = {child.get("link") for child in root.findall("joint/child")}
    roots = [name for name in (link.get("name", "") for link in root.findall("link")) if name not in children]
    if len(roots) != 1:
        raise DescriptionError(f"the description of {root.get('name')!r} must have one root link; it has {len(roots)}: {', '.join(roots) or 'none'}")
    return roots[0]
