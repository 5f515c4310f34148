"""Reading of URDF XML: the root element, numbers in attributes and origins, with errors that name the element."""

import math
import re
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, homogeneous, transform_from_rpy
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_core.magnitudes import largest, likely_unit

VERSIONS = ("1.0", "1.1", "1.2")
"""Supported versions of the URDF format; the first is the default. urdfdom 6 supports the same versions.

Version 1.1 introduced quat_xyzw, 1.2 the capsule; a capsule is read in any version."""
DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""Pattern of numbers that urdfdom reads: ASCII digits, a decimal point, an exponent."""


def parse(document: str | bytes) -> Element:
    """Return the `<robot>` element of a URDF document; its numbers remain text.

    Tags and attributes keep their prefix: as in urdfdom, XML namespaces have no effect, declared or not. Blank text
    before the XML declaration is ignored.

    Args:
        document: text, or the bytes of a file in the encoding that its XML declaration gives.

    Raises:
        DescriptionError: not XML, another root element, an unknown version, or an attribute that the version does not
            have.
    """
    builder, parser = TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler, parser.buffer_text = builder.data, True
    try:
        parser.Parse(document.lstrip("\ufeff \t\r\n") if isinstance(document, str) else _without_blank(document), True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # LookupError: unknown encoding
        raise DescriptionError(f"the robot description is not XML: {error}") from error
    root = builder.close()
    if root.tag != "robot":
        raise DescriptionError(
            f"the robot description starts with <{root.tag}>; it must be <robot> (a .xacro file must be expanded first)"
        )
    _check_version(root)
    return root


def _without_blank(content: bytes) -> bytes:
    return content.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n")


def _check_version(root: Element) -> None:
    version = root.get("version", VERSIONS[0])
    if version not in VERSIONS:
        raise DescriptionError(f"the robot description has version {version!r}; valid: {', '.join(VERSIONS)}")
    if left := next((element.tag for element in root.iter() if element.tag.startswith("xacro:")), None):
        raise DescriptionError(f"the robot description contains <{left}>; expand it with xacro first")
    for element in root.iter() if version == VERSIONS[0] else ():
        if any("quat_xyzw" in tag.attrib for tag in element.findall("origin")):
            raise DescriptionError(
                f"{element.tag} {element.get('name', '')}: quat_xyzw of <origin> needs URDF 1.1, and the description "
                f'has version 1.0, in which it is ignored; set version="1.1" in <robot>, or write rpy'
            )


def as_number(text: str, where: str) -> float:
    """Return `text` as a finite decimal number.

    Raises:
        DescriptionError: the text is not such a number; the message begins with `where`.
    """
    word = text.strip(" \t\r\n")
    value = float(word) if DECIMAL.fullmatch(word) else math.nan
    if not math.isfinite(value):
        raise DescriptionError(f"{where} must be a finite number; got {text!r}")
    return value


def number(element: Element, attribute: str, where: str, default: float | None = None) -> float:
    """Return the finite number in an attribute of an XML element.

    Args:
        element: element with the attribute.
        attribute: name of the attribute.
        where: owner of the element, for the error, e.g. "joint panda_joint1".
        default: value if the attribute is absent; None makes it required.

    Raises:
        DescriptionError: the attribute is absent and has no default, or is not a finite number.
    """
    text = element.get(attribute)
    if text is not None:
        return as_number(text, f"{where}: {attribute} of <{element.tag}>")
    if default is None:
        raise DescriptionError(f"{where}: <{element.tag}> has no {attribute}")
    return default


def numbers(element: Element, attribute: str, count: int, default: str, where: str) -> list[float]:
    """Return the `count` finite numbers in an attribute of an XML element; `default`: text if it is absent.

    Raises:
        DescriptionError: the attribute has another number of words, or a word is not a finite number; the message
            begins with `where`.
    """
    words, source = element.get(attribute, default).split(), f"{where}: {attribute} of <{element.tag}>"
    if len(words) != count:
        raise DescriptionError(f"{source} must be {count} numbers; got {element.get(attribute)!r}")
    return [as_number(word, source) for word in words]


def _realistic(tag: Element, name: str, unit: str, where: str) -> list[float]:
    """Return the three numbers of an attribute of `<origin>`; refuse one that is probably in another unit."""
    values, bound = numbers(tag, name, 3, "0 0 0", where), largest(unit)
    for value in values:
        if abs(value) > bound:
            likely = likely_unit(value, unit, -bound, bound)
            raise DescriptionError(f"{where}: {name} of <origin> has {value:g}, beyond {bound:.4g} [{unit}]{likely}")
    return values


def origin(element: Element, where: str) -> FloatArray:
    """Return the pose in an element's `<origin>`, shape (4, 4) [m]; the identity if there is no `<origin>`."""
    tag = element.find("origin")
    if tag is None:
        return np.eye(4)
    if "quat_xyzw" in tag.attrib:
        quaternion = np.array(numbers(tag, "quat_xyzw", 4, "", where))
        length = float(np.linalg.norm(quaternion))
        if "rpy" in tag.attrib or not length:
            raise DescriptionError(f"{where}: <origin> needs either rpy, or a quat_xyzw that is not zero")
        return homogeneous(rotation_from_quaternion((quaternion / length).tolist()), _realistic(tag, "xyz", "m", where))
    return transform_from_rpy(_realistic(tag, "xyz", "m", where), _realistic(tag, "rpy", "rad", where))
