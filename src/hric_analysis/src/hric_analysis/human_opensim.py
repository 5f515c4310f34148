"""Export of a run's simulated human for OpenSim: model, motion, and the grip forces as external loads."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import urdf_to_osim
from hric_bags.export import loads
from hric_bags.export.opensim_text import write_storage
from hric_bags.files import atomic
from hric_bags.records.human_record import HumanRecord
from hric_bags.run_file import NodeParameters
from hric_core.geometry import Pose
from hric_core.urdf import write_origin
from hric_human.muscles.choose import find
from hric_human.muscles.muscle_set import MuscleSet
from hric_human.muscles.opensim_paths import with_muscles
from hric_human.participant.settings import MUSCLE, HumanSettings
from hric_run.definition.parameters import HUMAN
from urdf_to_osim.transforms import base_pose

MODEL, MOTION = "human.osim", "human.mot"
LOADS, LOADS_SETUP = "human_external_loads.mot", "human_external_loads.xml"


def write(folder: Path, section: NodeParameters, record: HumanRecord, gravity: tuple[float, ...]) -> None:
    """Write human.osim, human.mot and, if there are grips, human_external_loads; overwrite existing files.

    With these files, OpenSim's inverse dynamics computes the joint torques of the human. The model has muscles if
    muscles drove the human.

    Args:
        folder: run folder.
        section: section `human` of the experiment.
        record: recording of the human from the bag.
        gravity: gravity vector in the world frame, 3 floats [m/s^2].

    Raises:
        HricError: the files cannot be written.
    """
    settings = HumanSettings.of(section, "human")
    body = settings.body()
    urdf = _standing(body.urdf, settings.root(body))
    options = urdf_to_osim.Options(gravity=gravity, inertia="keep", stops=False, friction="none", meshes=False)
    urdf_to_osim.write(urdf_to_osim.convert(urdf, options), folder / MODEL)
    if settings.drive == MUSCLE:
        anatomy = find(settings.muscles.anatomy, "human.muscles.anatomy")
        text = with_muscles((folder / MODEL).read_text(), MuscleSet(body, anatomy, settings.muscles.strength))
        with atomic(folder / MODEL) as path:
            path.write_text(text)
    columns = {name: record.position[:, j] for j, name in enumerate(record.joints)}
    with atomic(folder / MOTION) as path:
        write_storage(path, record.time, columns, "Coordinates", about={"units": "s, rad"})
    prefix = f"{HUMAN}::"
    hands = {name: grip.holder for name, grip in record.grips.items() if grip.holder.startswith(prefix)}
    if hands:
        _write_loads(folder, record, {name: holder.removeprefix(prefix) for name, holder in hands.items()})


def _standing(urdf: str, root: Pose) -> str:
    """Return the URDF of a human with a root link "world", to which the body is fixed at pose `root`."""
    robot = ElementTree.fromstring(urdf)
    SubElement(robot, "link", name="world")
    joint = SubElement(robot, "joint", name="world_to_human", type="fixed")
    SubElement(joint, "parent", link="world")
    SubElement(joint, "child", link="human_base")
    write_origin(joint, root.transform())
    return ElementTree.tostring(robot, encoding="unicode")


def _write_loads(folder: Path, record: HumanRecord, bodies: Mapping[str, str]) -> None:
    """Write the grip forces on the hands as external loads, with their set-up file; `bodies`: hand link by grip."""
    R, grips = base_pose("y")[:3, :3], [record.grips[name] for name in bodies]
    grip_loads = [
        loads.load(grip.name, bodies[grip.name], grip.time, R, (grip.force, grip.point, grip.torque), "")
        for grip in grips
    ]
    with atomic(folder / LOADS) as path:
        loads.write(grip_loads, path)
    with atomic(folder / LOADS_SETUP) as path:
        path.write_text(loads.setup(bodies, LOADS))
