"""Numbers of XML elements, with errors that name the element."""

import math
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from hric_control.errors import DescriptionError
from hric_control.geometry import FloatArray, transform_from_rpy


def parse(urdf_xml: str) -> Element:
    """The `<robot>` element.

    Raises:
        DescriptionError: not XML, or another root element.
    """
    try:
        root = ElementTree.fromstring(urdf_xml)
    except (ElementTree.ParseError, ValueError) as error:  # ValueError: e.g. an encoding that Python does not know
        raise DescriptionError(f"the robot description is not XML: {error}") from error
    if root.tag != "robot":
        raise DescriptionError(
            f"the robot description starts with <{root.tag}>; it must be <robot> (a .xacro file must be expanded first)"
        )
    return root


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


def number(element: Element, attribute: str, where: str, default: float | None = None) -> float:
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
    if text is not None:
        return as_number(text, f"{where}: {attribute} of <{element.tag}>")
    if default is None:
        raise DescriptionError(f"{where}: <{element.tag}> has no {attribute}")
    return default


def numbers(element: Element, attribute: str, count: int, default: str, where: str) -> list[float]:
    """`count` finite numbers of an attribute; `default` is its text where it is absent.

    Raises:
        DescriptionError: other than that; the message begins with `where`.
    """
    words, source = element.get(attribute, default).split(), f"{where}: {attribute} of <{element.tag}>"
    if len(words) != count:
        raise DescriptionError(f"{source} must be {count} numbers; got {element.get(attribute)!r}")
    return [as_number(word, source) for word in words]


def origin(element: Element, where: str) -> FloatArray:
    """Pose of an element's `<origin>`, the identity without one, shape (4, 4) [m]."""
    tag = element.find("origin")
    if tag is None:
        return np.eye(4)
    return transform_from_rpy(numbers(tag, "xyz", 3, "0 0 0", where), numbers(tag, "rpy", 3, "0 0 0", where))
