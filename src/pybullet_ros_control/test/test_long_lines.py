"""The engine reads a line in pieces and breaks what is at a seam: no file that is written for it may have such a
line."""

from collections.abc import Callable

import numpy as np
import pytest

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.urdf import read
from pybullet_ros_control.engine import PhysicsClient
from pybullet_ros_control.urdf_model import NAME, PIECE, prepare

LINKS = 24
VARIANTS = 20
"""Of the padding for each seed; seven seeds give 140 descriptions."""


Padding = Callable[[int], str]


def padding(random: np.random.Generator) -> Padding:
    """What makes words of a random length, with letters of one, two and three bytes."""
    return lambda longest: "".join(random.choice(list("axé→"), int(random.integers(longest))))


def chain(seed: int, word: Padding) -> str:
    """A chain with random joint origins, and padding in names, text, comments and attributes."""
    random, parts = np.random.default_rng(seed), ['<link name="link0"/>']
    for number in range(1, LINKS):
        xyz, rpy = (" ".join(map(str, random.uniform(-size, size, 3))) for size in (0.1, 3.0))
        parts.append(
            f'<link name="link{number}"><inertial><mass value="0.5"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
            'ixy="0" ixz="0" iyz="0"/></inertial>'
            f'<collision name="{word(30)}">{word(60)}<!-- {word(60)} -->'
            f'<geometry><box size="0.01 0.01 0.01" a="{word(30)}" b="{word(30)}"/></geometry></collision></link>'
            f'<joint name="joint{number}{word(100)}" type="revolute"><parent link="link{number - 1}"/><child '
            f'link="link{number}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" '
            'velocity="1"/></joint>'
        )
    return f'<robot name="chain">{"".join(parts)}</robot>'


def tip(engine: PhysicsClient, urdf_xml: str) -> FloatArray:
    """Pose of the last link at q = 0, shape (4, 4) [m]."""
    body = engine.load("chain", prepare(read(urdf_xml)), np.eye(4), fixed_base=True, self_collision=False)
    pose = engine.pose(body, body.links[f"link{LINKS - 1}"])
    engine.remove(body)
    return pose


@pytest.mark.parametrize("seed", range(7))
def test_padding_of_a_description_moves_no_link(seed: int) -> None:
    engine, word = PhysicsClient(False, 1e-3, (0.0, 0.0, 0.0)), padding(np.random.default_rng(seed))
    try:
        plain = tip(engine, chain(seed, lambda longest: ""))
        errors = [float(np.max(np.abs(tip(engine, chain(seed, word)) - plain))) for _ in range(VARIANTS)]
    finally:
        engine.close()
    assert errors == [0.0] * VARIANTS


def test_no_line_of_a_written_description_is_longer_than_a_piece() -> None:
    words = padding(np.random.default_rng(0))
    xml = prepare(read(chain(0, lambda longest: words(3 * longest)))).xml
    assert max(len(line.encode()) for line in xml.splitlines(keepends=True)) <= PIECE


def test_an_attribute_that_fits_in_no_piece_is_one_clear_error() -> None:
    urdf_xml = f'<robot name="r"><link name="{"n" * 1024}"/></robot>'
    with pytest.raises(DescriptionError, match=f"name of <link>: {NAME + 1} bytes .*at most {NAME} bytes"):
        prepare(read(urdf_xml))
