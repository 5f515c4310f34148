"""Robot descriptions (URDF): a tree of links and joints with numbers instead of text, its reader, and its writers.

    robot = read(urdf_xml)
    robot.joints["panda_joint1"].upper

An invalid description is refused here, with an error that names the element: see `read`. Valid content that only some
programs do not support, such as floating joints in PyBullet or an impossible inertia, is refused by those programs.
"""

from hric_core.urdf.reading import read
from hric_core.urdf.robot import (
    BOUNDED,
    NO_LIMIT,
    ONE_COORDINATE,
    Joint,
    Limit,
    Link,
    Mimic,
    Robot,
    SafetyController,
    mimic_laws,
)
from hric_core.urdf.shapes import Shape, join_capsules, solids
from hric_core.urdf.writing import write_inertial, write_origin, write_shape

__all__ = [
    "BOUNDED",
    "NO_LIMIT",
    "ONE_COORDINATE",
    "Joint",
    "Limit",
    "Link",
    "Mimic",
    "Robot",
    "SafetyController",
    "Shape",
    "join_capsules",
    "mimic_laws",
    "read",
    "solids",
    "write_inertial",
    "write_origin",
    "write_shape",
]
