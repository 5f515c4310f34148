"""Make the animated picture of README.md from a headless run: python3 tests/moving_picture.py.

The picture shows the arm pressing a person's forearm against a wall with its hand, and next to it the force on the
forearm with its limits. It takes about a minute, and needs `scripts/setup --with pictures`.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from hric_assessment.contact.limits import Limits
from hric_bags.records.region_contacts import ContactRecord
from hric_report import drawing, headless, style
from hric_report.film.pictures import FilmView, opened
from hric_report.html import run_data
from hric_run.definition import experiment

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
VIEW = FilmView(WIDTHS[0], HEIGHT, azimuth=-1.5, elevation=0.5)
"""Size of the scene, and direction of the camera."""


def main() -> None:
    """Run the experiment and write its animated picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=PICTURE, help="file of the picture (default: %(default)s)")
    output = parser.parse_args().output
    with tempfile.TemporaryDirectory() as folder:
        frames = list(pictures(run(Path(folder))))
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


def pictures(data: run_data.RunData) -> Iterator[Image.Image]:
    """Yield the frames of the picture: the scene of `hric film`, and the curve of the force."""
    assert data.person is not None
    contact = data.person.record.contacts[LINK]
    with opened(data) as scene:
        scene.prepare(VIEW, BEGIN, END)
        for time in np.arange(BEGIN, END, 1.0 / RATE).tolist():
            picture = Image.new("RGB", (sum(WIDTHS), HEIGHT))
            picture.paste(scene.draw(time), (0, 0))
            picture.paste(curve(contact, time), (WIDTHS[0], 0))
            yield picture


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
