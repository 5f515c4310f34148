"""OpenSim files of a person's motion: the fitted body as a model, its coordinates, the loads, and a set-up file.

    write_model(folder, body)
    write_dynamics(folder, moments)             # then: opensim-cmd run-tool inverse_dynamics.xml

The model is the body of the person with six coordinates of its root link in the laboratory, so that OpenSim's inverse
dynamics can be compared with this project's. Its ground has y up, as usual in OpenSim.
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import urdf_to_osim
from hric_bags.export.opensim_text import write_storage
from hric_core.geometry import FloatArray
from hric_human.body import Body
from hric_human.body.segments import ROOT
from hric_motion.moments import JointMoments

LABORATORY = "laboratory"
"""Root link of the description that is converted."""
ROOT_COORDINATES = (
    *(("root_x", "prismatic", "1 0 0"), ("root_y", "prismatic", "0 1 0"), ("root_z", "prismatic", "0 0 1")),
    *(("root_roll", "revolute", "1 0 0"), ("root_pitch", "revolute", "0 1 0"), ("root_yaw", "revolute", "0 0 1")),
)
"""Coordinates of the root link: name, type of joint, axis. The rotations are intrinsic, in this order."""
FAR = "1000"
"""Limit of the root coordinates and of their velocities [m], [rad], so large that it has no effect."""
R_GROUND_LAB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation from the axes of the laboratory, z up, to those of OpenSim's ground, y up."""
MODEL, MOTION, LOADS = "human.osim", "inverse_dynamics.mot", "loads.sto"
SETUP, MOMENTS = "inverse_dynamics.xml", "moments.sto"


def described(urdf: str) -> str:
    """Return the URDF of a body, to which joints between laboratory and root link (ROOT_COORDINATES) are added."""
    robot = ElementTree.fromstring(urdf)
    parent = LABORATORY
    ElementTree.SubElement(robot, "link", name=LABORATORY)
    for name, kind, axis in ROOT_COORDINATES:
        child = ROOT if name == ROOT_COORDINATES[-1][0] else f"{name}_link"
        if child != ROOT:
            ElementTree.SubElement(robot, "link", name=child)
        joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        ElementTree.SubElement(joint, "axis", xyz=axis)
        ElementTree.SubElement(joint, "limit", lower=f"-{FAR}", upper=FAR, velocity=FAR, effort=FAR)
        parent = child
    return ElementTree.tostring(robot, encoding="unicode")


def coordinates(moments: JointMoments) -> dict[str, FloatArray]:
    """Return the coordinates of the model by name, shape (n,) each [m], [rad]."""
    angles = root_angles(moments.root.orientation)
    names = [name for name, _, _ in ROOT_COORDINATES]
    columns = np.hstack([moments.root.position, angles, moments.motion.q])
    return dict(zip([*names, *moments.body.joints], columns.T, strict=True))


def root_angles(orientation: FloatArray) -> FloatArray:
    """Return roll, pitch and yaw coordinates of the root link, shape (n, 3) [rad].

    Args:
        orientation: quaternions x, y, z, w, shape (n, 4); NaN: not known.
    """
    angles, known = np.full((len(orientation), 3), np.nan), np.isfinite(orientation).all(axis=1)
    if known.any():
        angles[known] = np.unwrap(Rotation.from_quat(orientation[known]).as_euler("XYZ"), axis=0)
    return angles


def write_model(folder: Path, body: Body) -> None:
    """Write the OpenSim model of a body to a folder."""
    options = urdf_to_osim.Options(inertia="keep", stops=False, friction="none", meshes=False)
    urdf_to_osim.write(urdf_to_osim.convert(described(body.urdf), options), folder / MODEL)


def write_dynamics(folder: Path, moments: JointMoments) -> None:
    """Write coordinates, loads and the set-up of OpenSim's inverse dynamics to the folder with the model."""
    time = moments.motion.time
    write_storage(folder / MOTION, time, coordinates(moments), "Coordinates")
    columns = dict[str, FloatArray]()
    for number, load in enumerate(moments.loads, 1):
        for kind, vectors in (("force", load.force), ("point", load.point), ("torque", load.torque)):
            for axis, column in zip("xyz", R_GROUND_LAB @ vectors.T, strict=True):
                columns[f"load_{number}_{kind}_{axis}"] = column
    if columns:
        write_storage(folder / LOADS, time, columns, "Loads")
        _write_xml(_loads([load.link for load in moments.loads]), folder / "loads.xml")
    _write_xml(_tool(time, bool(columns)), folder / SETUP)


def _loads(links: list[str]) -> ElementTree.Element:
    """Return OpenSim's XML element of the external loads that act on these links."""
    document = ElementTree.Element("OpenSimDocument", Version="40000")
    loads = ElementTree.SubElement(document, "ExternalLoads", name="loads")
    objects = ElementTree.SubElement(loads, "objects")
    for number, link in enumerate(links, 1):
        load = ElementTree.SubElement(objects, "ExternalForce", name=f"load_{number}")
        values = {
            "isDisabled": "false",
            "applied_to_body": link,
            "force_expressed_in_body": "ground",
            "point_expressed_in_body": "ground",
            **{f"{kind}_identifier": f"load_{number}_{kind}_" for kind in ("force", "point", "torque")},
        }
        for key, value in values.items():
            ElementTree.SubElement(load, key).text = value
    ElementTree.SubElement(loads, "datafile").text = LOADS
    return document


def _tool(time: FloatArray, loaded: bool) -> ElementTree.Element:
    """Return the set-up of OpenSim's inverse dynamics tool as XML."""
    document = ElementTree.Element("OpenSimDocument", Version="40000")
    tool = ElementTree.SubElement(document, "InverseDynamicsTool", name="inverse_dynamics")
    values = {
        "results_directory": ".",
        "model_file": MODEL,
        "time_range": f"{time[0]:.9g} {time[-1]:.9g}",
        "forces_to_exclude": "Muscles",
        "external_loads_file": "loads.xml" if loaded else "",
        "coordinates_file": MOTION,
        "lowpass_cutoff_frequency_for_coordinates": "-1",
        "output_gen_force_file": MOMENTS,
    }
    for key, value in values.items():
        ElementTree.SubElement(tool, key).text = value
    return document


def _write_xml(document: ElementTree.Element, path: Path) -> None:
    ElementTree.indent(document)
    ElementTree.ElementTree(document).write(path, encoding="unicode", xml_declaration=True)
