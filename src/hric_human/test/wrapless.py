"""arm26 without its wrapping surfaces, for OpenSim and as a MuJoCo model with the same points, joints and muscles."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import opensim
from arm26_model import FILE

FIBRES = (0.5, 1.5)
"""Range of MuJoCo's muscles [1]."""


def opensim_text() -> str:
    """Return the text of the OpenSim model."""
    root = ElementTree.fromstring(FILE.read_text())
    for path in root.iter("GeometryPath"):
        for wraps in path.findall("PathWrapSet"):
            path.remove(wraps)
    return ElementTree.tostring(root, encoding="unicode")


def write_mujoco(path: Path, osim: Path) -> None:
    """Write the MuJoCo model: y up as in OpenSim; its masses have no effect."""
    model = opensim.Model(str(osim))
    model.initSystem()
    points = dict[str, list[str]]()
    tendons, actuators = [], []
    muscles = [model.getMuscles().get(i) for i in range(model.getMuscles().getSize())]
    for muscle in muscles:
        name, sites = muscle.getName(), []
        path_points = opensim.GeometryPath.safeDownCast(muscle.getPath()).getPathPointSet()
        for i in range(path_points.getSize()):
            point = opensim.PathPoint.safeDownCast(path_points.get(i))
            body = point.getParentFrame().findBaseFrame().getName()
            label = f"{name}_{i}"
            points.setdefault(body, []).append(f'<site name="{label}" pos="{_text(point.get_location())}"/>')
            sites.append(f'<site site="{label}"/>')
        tendons.append(f'<spatial name="{name}_tendon">{"".join(sites)}</spatial>')
        optimal, slack = muscle.getOptimalFiberLength(), muscle.getTendonSlackLength()
        lengths = " ".join(repr(slack + end * optimal) for end in FIBRES)
        actuators.append(
            f'<muscle name="{name}" tendon="{name}_tendon" force="{muscle.getMaxIsometricForce()!r}" '
            f'range="{FIBRES[0]} {FIBRES[1]}" lengthrange="{lengths}"/>'
        )
    bodies = ""
    for name, joint, limits in (("r_ulna_radius_hand", "r_elbow", "0 2.2"), ("r_humerus", "r_shoulder", "-1.5 3.1")):
        one = opensim.CustomJoint.safeDownCast(model.getJointSet().get(joint))
        place = opensim.PhysicalOffsetFrame.safeDownCast(one.getParentFrame()).get_translation()
        axis = one.getSpatialTransform().get_rotation1().getAxis()
        com = model.getBodySet().get(name).getMassCenter()
        bodies = (
            f'<body name="{name}" pos="{_text(place)}"><inertial pos="{_text(com)}" mass="1" diaginertia="1 1 1"/>'
            f'<joint name="{joint}" axis="{_text(axis)}" range="{limits}" limited="true"/>{"".join(points[name])}'
            f"{bodies}</body>"
        )
    bodies += "".join(points["base"])
    path.write_text(
        f'<mujoco><compiler angle="radian"/><option gravity="0 -9.81 0"/><worldbody><body name="base">{bodies}</body>'
        f"</worldbody><tendon>{''.join(tendons)}</tendon><actuator>{''.join(actuators)}</actuator></mujoco>"
    )


def _text(vector: object) -> str:
    return " ".join(repr(float(x)) for x in np.array(vector.to_numpy()))  # type: ignore[attr-defined]
