"""Make the animated picture of README.md from a headless run: python3 tests/moving_picture.py.

The picture shows the arm pressing a person's forearm against a wall with its hand, and next to it the force on the
forearm with its limits. It takes about a minute, and needs `scripts/setup --with pictures`.
"""

import argparse
import io
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation

from hric_assessment.contact.limits import Limits
from hric_assessment.separation.capsules import poses
from hric_bags.records.region_contacts import ContactRecord
from hric_core import urdf
from hric_core.geometry import FloatArray, homogeneous
from hric_core.meshes.files import read_coloured
from hric_report import drawing, headless, style
from hric_report.html import human_and_objects, moving, run_data
from hric_report.html.meshes import decimate
from hric_report.html.scene import GREY, SceneRobot, mesh_path
from hric_run.definition import experiment
from urdf_to_osim.decorations import DecoratedModel, Decoration, Look
from urdf_to_osim.drawing.on_demand import install_vtk

PICTURE = Path(__file__).parents[1] / "docs" / "moving_picture.webp"
EXPERIMENT = "contact"
ARGUMENTS = (
    "simulator:=mujoco",
    "world:=package://hric_experiments/worlds/wall_behind_arm.yaml",
    "human.parts:=upper_body",
    "parameters.joint_pd_controller.kp:=800",
    "parameters.joint_pd_controller.kd:=40",
    "robot.parameters.reflexes:=false",
)
LINK = "r_elbow"
"""Link of the person whose contact is shown: the forearm."""
BEGIN, END, RATE, SLOWER = 0.7, 2.1, 25.0, 2.0
"""Start and end of the shown part of the run [s], frames per second of the run [Hz], and slow-motion factor [1]."""
HEIGHT, WIDTHS = 380, (440, 340)
"""Height of the picture, and widths of scene and curve [px]."""
LOW, HIGH = np.array([-0.2, -0.4, 0.1]), np.array([0.9, 0.5, 0.9])
"""Corners of the box that the camera keeps in view [m]."""
VIEW = {"azimuth": -80.0, "elevation": 40.0}
"""Direction of the camera [deg]."""
CYLINDER = homogeneous(Rotation.from_euler("x", 90.0, degrees=True).as_matrix(), np.zeros(3))
"""Transform for cylinders, whose axis is z in the description and y in the drawing."""


def main() -> None:
    """Run the experiment and write its animated picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=PICTURE, help="file of the picture (default: %(default)s)")
    output = parser.parse_args().output
    install_vtk()
    with tempfile.TemporaryDirectory() as folder:
        frames = list(pictures(run(Path(folder)), Path(folder)))
    duration = round(1e3 * SLOWER / RATE)
    durations = [duration] * (len(frames) - 1) + [1500]
    options = {"quality": 60, "method": 6, "minimize_size": True}
    frames[0].save(output, save_all=True, append_images=frames[1:], duration=durations, loop=0, **options)
    print(f"{output}: {len(frames)} pictures, {output.stat().st_size / 1e6:.2f} MB")


def run(folder: Path) -> run_data.RunData:
    """Run the experiment headless below a folder and read its data."""
    definition = experiment.load(EXPERIMENT, ARGUMENTS)
    result = headless.run(definition, ARGUMENTS, root=folder, progress=False, figures=False)
    return run_data.load(result.folder, result.metrics)


def pictures(data: run_data.RunData, folder: Path) -> Iterator[Image.Image]:
    """Yield the frames of the picture; converted meshes are written to the folder."""
    from urdf_to_osim.drawing.drawing import draw

    assert data.person is not None
    robots = [moving.robot(data, 1e3, []), *human_and_objects.human(data, 1e3), *human_and_objects.objects(data)]
    contact = data.person.record.contacts[LINK]
    look = Look(WIDTHS[0], HEIGHT, centres=False, **VIEW)
    for time in np.arange(BEGIN, END, 1.0 / RATE):
        shown = [decoration for robot in robots for decoration in decorations(robot, time, folder)]
        corners = Decoration(
            "brick", tuple(0.5 * (HIGH - LOW)), homogeneous(np.eye(3), 0.5 * (HIGH + LOW)), (1, 1, 1), 0.0, False
        )
        scene = Image.open(io.BytesIO(draw(DecoratedModel([*shown, corners], {}, {}, np.eye(3)[2], []), look)))
        picture = Image.new("RGB", (sum(WIDTHS), HEIGHT))
        picture.paste(scene, (0, 0))
        picture.paste(curve(contact, time), (WIDTHS[0], 0))
        yield picture


def decorations(robot: SceneRobot, time: float, folder: Path) -> Iterator[Decoration]:
    """Yield the shapes of a robot, person or object at a time of the run [s]."""
    tree = urdf.read(robot.description)
    q = np.array([[np.interp(time, robot.time, column) for column in robot.position.T]])
    xyz, quaternion = robot.pose
    if robot.motion is not None:
        pose = robot.motion.values[min(np.searchsorted(robot.motion.time, time), len(robot.motion.time) - 1)]
        xyz, quaternion = pose[:3], pose[3:]
    root = homogeneous(Rotation.from_quat(quaternion).as_matrix(), np.array(xyz))
    for link, T in poses(tree, robot.joint_names, q, root[None]).items():
        for shape in tree.links[link].visuals:
            yield from parts(shape, T[0] @ shape.T_link_shape, folder)


def parts(shape: urdf.Shape, T: FloatArray, folder: Path) -> Iterator[Decoration]:
    """Yield the drawn parts of a shape at a pose; a mesh has one part per colour."""
    colour = shape.colour or GREY
    if shape.kind == "mesh":
        for file, own in files(shape.address, shape.size, folder):
            red, green, blue, opacity = own or colour
            yield Decoration("mesh", (1.0, 1.0, 1.0), T, (red, green, blue), opacity, False, str(file))
        return
    kind, size = {
        "box": ("brick", tuple(0.5 * edge for edge in shape.size)),
        "sphere": ("sphere", shape.size[:1] * 3),
        "cylinder": ("cylinder", (shape.size[0], 0.5 * shape.size[-1], shape.size[0])),
    }[shape.kind]
    yield Decoration(kind, size, T @ CYLINDER if kind == "cylinder" else T, colour[:3], colour[3], False)


@lru_cache
def files(address: str, scale: tuple[float, ...], folder: Path) -> list[tuple[Path, tuple[float, ...] | None]]:
    """Write the surfaces of a mesh as STL, one for each colour, and return them with the colours."""
    path = mesh_path(address)
    written = []
    for surface, colour in read_coloured(path, path.read_bytes(), (scale[0], scale[1], scale[2])):
        file = folder / f"{path.stem}_{len(written)}.stl"
        few = decimate(surface)
        trimesh.Trimesh(few.vertices, few.faces, process=False).export(file)
        written.append((file, colour))
    return written


def curve(contact: ContactRecord, time: float) -> Image.Image:
    """Return a plot of the force with its limits, up to a time of the run [s]."""
    limit = Limits.named().at(contact.regions)
    assert limit is not None and limit.force.transient is not None
    known = contact.time <= time
    with plt.rc_context({**drawing.STYLE, "font.size": 8.0}):
        figure = plt.figure(figsize=(WIDTHS[1] / 100, HEIGHT / 100), dpi=100)
        axes = figure.add_axes((0.15, 0.12, 0.81, 0.8), xlim=(BEGIN, END), ylim=(0.0, 1.1 * limit.force.transient))
        axes.set(title=f"force on {', '.join(contact.regions)}", xlabel="time [s]", ylabel="force [N]")
        for name, value in (
            ("transient limit", limit.force.transient),
            ("quasi-static limit", limit.force.quasi_static),
        ):
            axes.axhline(value, color=style.LIMIT[0], linestyle="--", linewidth=1.0)
            axes.text(BEGIN + 0.03, value + 4.0, f"{name}, ISO/TS 15066: {value:.0f} N", color=style.LIMIT[0])
        axes.plot(contact.time[known], contact.force[known], **drawing.stroke("measured"))
        if known.any():
            axes.plot(
                contact.time[known][-1],
                contact.force[known][-1],
                "o",
                color=style.ROLES["measured"].light,
                markersize=4,
            )
        figure.canvas.draw()
        image = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
        plt.close(figure)
    return image


if __name__ == "__main__":
    main()
