"""A right arm for OpenSim with what models of arms have and arm26 has not: a girdle that a coupler moves, a shoulder of
three coordinates in another order, a forearm and a wrist; senses, zeros, names and axes of bodies are not ours.

Its ground has x forward, y up, z right.
"""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

FOREARM = 0.25
COUPLED = -0.3
"""Factor of the coupler: angle of the clavicle per square of the arm's elevation [1/rad]."""
R_HUMERUS = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Rotation from the ground's axes to those of the body humerus_r, with the arm hanging."""
JOINTS = {
    "thorax": ("ground", (0.0, 0.0, 0.0), ()),
    "clavicle_r": ("thorax", (0.0, 0.0, 0.03), (("girdle", (1, 0, 0), (-90, 90)),)),
    "humphant_r": (
        "clavicle_r",
        (-0.02, -0.01, 0.14),
        (("plane", (0, 1, 0), (-100, 140)), ("elevation", (-1, 0, 0), (0, 170))),
    ),
    "humerus_r": ("humphant_r", (0.0, 0.0, 0.0), (("turn", (0, 1, 0), (-150, 150)),)),
    "ulna_r": ("humerus_r", (0.0, -0.3, 0.0), (("elbow", (0, 0, -1), (-140, 0)),)),
    "radius_r": ("ulna_r", (0.0, 0.0, 0.0), (("supination", (0, 1, 0), (0, 180)),)),
    "hand_r": ("radius_r", (0.0, -FOREARM, 0.02), (("bend", (0, 0, 1), (-70, 70)), ("deviate", (1, 0, 0), (-25, 35)))),
}
"""Parent, place in it [m], and coordinates with axis and range [deg]; in the ground's axes, of a hanging arm with its
palm forward."""
PATHS = {
    "deltoid": (("clavicle_r", (0.01, 0.02, 0.14)), ("humerus_r", (0.005, -0.1, 0.012))),
    "pectoralis": (("thorax", (0.05, -0.12, 0.03)), ("humerus_r", (0.008, -0.05, 0.006))),
    "infraspinatus": (("clavicle_r", (-0.09, -0.05, 0.08)), ("humerus_r", (-0.02, 0.0, 0.015))),
    "biceps": (("clavicle_r", (0.02, 0.0, 0.13)), ("humerus_r", (0.03, -0.2, 0)), ("radius_r", (0.01, -0.05, -0.012))),
    "triceps": (("humerus_r", (-0.02, -0.1, 0.0)), ("ulna_r", (-0.022, 0.01, 0.0))),
    "pronator": (("humerus_r", (0.0, -0.28, -0.03)), ("radius_r", (0.008, -0.1, 0.013))),
    "flexor": (("radius_r", (0.0, -0.1, -0.015)), ("hand_r", (0.012, -0.05, -0.004))),
    "of_the_trunk": (("ground", (0.0, 0.0, 0.0)), ("thorax", (0.0, 0.3, 0.0))),
}
"""Points on bodies [m], axes as above."""
FORCE, OPTIMAL, SLACK, PENNATION = 500.0, 0.12, 0.09, {"deltoid": 0.5}
"""Maximum isometric force [N], optimal fibre length [m], tendon slack length [m], pennation [rad] of each muscle."""


def write(path: Path) -> None:
    """Write the OpenSim model."""
    bodies = "".join(map(_body, JOINTS))
    joints = "".join(_joint(name, *of) for name, of in JOINTS.items())
    muscles = "".join(_muscle(name, points) for name, points in PATHS.items())
    coupler = (
        '<CoordinateCouplerConstraint name="rhythm"><coupled_coordinates_function><PolynomialFunction>'
        f"<coefficients>{COUPLED} 0 0</coefficients></PolynomialFunction></coupled_coordinates_function>"
        "<independent_coordinate_names>elevation</independent_coordinate_names><dependent_coordinate_name>girdle"
        "</dependent_coordinate_name></CoordinateCouplerConstraint>"
    )
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?><OpenSimDocument Version="40000"><Model name="built"><credits>Somebody'
        f"</credits><gravity>0 -9.81 0</gravity>{_set('Body', bodies)}{_set('Joint', joints)}"
        f"{_set('Constraint', coupler)}{_set('Force', muscles)}</Model></OpenSimDocument>"
    )


def _set(kind: str, members: str) -> str:
    return f'<{kind}Set name="{kind.lower()}set"><objects>{members}</objects></{kind}Set>'


def _text(values: object) -> str:
    return " ".join(repr(float(value)) for value in np.ravel(values))


def _address(body: str) -> str:
    return "/ground" if body == "ground" else f"/bodyset/{body}"


def _own(body: str, vector: object) -> str:
    """Return a vector of ground axes in axes of a body."""
    return _text(R_HUMERUS @ vector if body == "humerus_r" else vector)


def _orientation(body: str) -> str:
    """Return the orientation of the ground's axes in a body's axes."""
    return _text(Rotation.from_matrix(R_HUMERUS if body == "humerus_r" else np.eye(3)).as_euler("XYZ"))


def _body(name: str) -> str:
    return (
        f'<Body name="{name}"><mass>1</mass><mass_center>{_own(name, (0, -0.1, 0))}</mass_center>'
        "<inertia>1 1 1 0 0 0</inertia></Body>"
    )


def _joint(name: str, parent: str, place: object, coordinates: tuple) -> str:
    frames = "".join(
        f'<PhysicalOffsetFrame name="{label}"><socket_parent>{_address(body)}</socket_parent><translation>'
        f"{_own(body, at)}</translation><orientation>{_orientation(body)}</orientation></PhysicalOffsetFrame>"
        for label, body, at in (("before", parent, place), ("behind", name, (0, 0, 0)))
    )
    sockets = "<socket_parent_frame>before</socket_parent_frame><socket_child_frame>behind</socket_child_frame>"
    if not coordinates:
        return f'<WeldJoint name="{name}_joint">{sockets}<frames>{frames}</frames></WeldJoint>'
    angles = "".join(
        f'<Coordinate name="{coordinate}"><range>{_text(np.radians(limits))}</range></Coordinate>'
        for coordinate, _, limits in coordinates
    )
    rest = iter(np.eye(3)[[i for i in range(3) if not any(abs(axis[i]) for _, axis, _ in coordinates)]])
    turns = "".join(
        f'<TransformAxis name="rotation{k + 1}"><coordinates>{coordinate}</coordinates><axis>{_text(axis)}</axis>'
        '<LinearFunction name="function"><coefficients>1 0</coefficients></LinearFunction></TransformAxis>'
        for k, (coordinate, axis, _) in enumerate(coordinates)
    ) + "".join(
        f'<TransformAxis name="rotation{k + 1}"><axis>{_text(next(rest))}</axis><Constant name="function"><value>0'
        "</value></Constant></TransformAxis>"
        for k in range(len(coordinates), 3)
    )
    return (
        f'<CustomJoint name="{name}_joint">{sockets}<coordinates>{angles}</coordinates><frames>{frames}</frames>'
        f"<SpatialTransform>{turns}</SpatialTransform></CustomJoint>"
    )


def _muscle(name: str, points: tuple) -> str:
    path = "".join(
        f'<PathPoint name="{name}_{i}"><socket_parent_frame>{_address(body)}</socket_parent_frame>'
        f"<location>{_own(body, point)}</location></PathPoint>"
        for i, (body, point) in enumerate(points)
    )
    return (
        f'<Thelen2003Muscle name="{name}"><GeometryPath name="geometrypath"><PathPointSet><objects>{path}</objects>'
        "</PathPointSet></GeometryPath>"
        f"<max_isometric_force>{FORCE}</max_isometric_force><optimal_fiber_length>{OPTIMAL}</optimal_fiber_length>"
        f"<tendon_slack_length>{SLACK}</tendon_slack_length><pennation_angle_at_optimal>{PENNATION.get(name, 0.0)}"
        "</pennation_angle_at_optimal></Thelen2003Muscle>"
    )
