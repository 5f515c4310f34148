"""The collision capsules lie close to the meshes and do not overlap where the arm does not touch itself."""

from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

import panda_description
from panda_description import parameters

PARTS = parameters.config("collision")["links"]


def vertices(part: str) -> np.ndarray:
    """Points of the part's mesh, shape (n, 3) [m]."""
    path = Path(parameters.folder_uri().removeprefix("file://")) / parameters.config("meshes")["links"][part]
    return np.array([line.split()[1:4] for line in path.read_text().splitlines() if line.startswith("v ")], dtype=float)


def distance(points: np.ndarray, capsule: dict) -> np.ndarray:
    """From each point to the capsule's surface, negative inside, shape (n,) [m]."""
    start, end = np.array(capsule["from"]), np.array(capsule["to"])
    axis = end - start
    along = np.clip((points - start) @ axis / max(axis @ axis, 1e-12), 0.0, 1.0)
    return np.linalg.norm(points - start - along[:, None] * axis, axis=1) - capsule["radius"]


@pytest.mark.parametrize("part", PARTS)
def test_the_capsules_of_a_link_lie_close_to_its_mesh(part: str) -> None:
    gaps = np.min([distance(vertices(part), capsule) for capsule in PARTS[part]], axis=0)
    assert gaps.max() < 0.025
    assert np.median(gaps) < 0.0055


def test_cylinders_of_the_urdf_run_from_one_end_of_the_capsule_to_the_other() -> None:
    robot = ElementTree.fromstring(panda_description.load())
    for name, part, turn in [
        *((part, part, 1) for part in PARTS if part != "finger"),
        ("leftfinger", "finger", 1),
        ("rightfinger", "finger", -1),
    ]:
        elements = robot.findall(f"link[@name='panda_{name}']/collision")
        cylinders = [element for element in elements if element.find("geometry/cylinder") is not None]
        capsules = [capsule for capsule in PARTS[part] if capsule["from"] != capsule["to"]]
        assert len(elements) == len(PARTS[part]) + 2 * len(capsules)
        for cylinder, capsule in zip(cylinders, capsules, strict=True):
            roll, pitch, yaw = map(float, cylinder.find("origin").attrib["rpy"].split())
            axis = np.array([np.sin(pitch) * np.cos(yaw), np.sin(pitch) * np.sin(yaw), np.cos(pitch)])
            middle = np.array(cylinder.find("origin").attrib["xyz"].split(), dtype=float)
            half = float(cylinder.find("geometry/cylinder").attrib["length"]) / 2
            assert roll == 0.0
            for sign, end in ((-1, "from"), (1, "to")):
                assert_allclose(
                    middle + sign * half * axis, np.array(capsule[end]) * [turn, turn, 1], rtol=0, atol=1e-12
                )


def overlapping(count: int, urdf: Path) -> Counter[tuple[str, str]]:
    """Pairs of links, beside those that share a joint, whose capsules overlap in random legal poses, with how often."""
    import pybullet

    urdf.write_text(panda_description.load(meshes=False))
    engine = pybullet.connect(pybullet.DIRECT)
    try:
        flags = pybullet.URDF_USE_SELF_COLLISION | pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT
        body = pybullet.loadURDF(str(urdf), useFixedBase=True, flags=flags, physicsClientId=engine)
        info = [
            pybullet.getJointInfo(body, i, physicsClientId=engine)
            for i in range(pybullet.getNumJoints(body, physicsClientId=engine))
        ]
        names = [entry[12].decode().removeprefix("panda_") for entry in info]
        moving = [entry[0] for entry in info if entry[2] == pybullet.JOINT_REVOLUTE]
        random, limits = np.random.default_rng(1), panda_description.joint_limits().values()
        found: Counter[tuple[str, str]] = Counter()
        for _ in range(count):
            for joint, limit in zip(moving, limits, strict=True):
                pybullet.resetJointState(body, joint, random.uniform(limit.lower, limit.upper), physicsClientId=engine)
            pybullet.performCollisionDetection(physicsClientId=engine)
            contacts = pybullet.getContactPoints(body, body, physicsClientId=engine)
            found.update(
                {tuple(sorted((names[contact[3]], names[contact[4]]))) for contact in contacts if contact[8] < 0.0}
            )
        return found
    finally:
        pybullet.disconnect(engine)


def test_pairs_that_always_overlap_are_masked_and_neighbours_in_the_chain_but_one_stay_clear(tmp_path: Path) -> None:
    found = overlapping(500, tmp_path / "panda.urdf")
    masked = {
        tuple(sorted((a.removeprefix("panda_"), b.removeprefix("panda_"))))
        for a, b in panda_description.ignored_pairs()
    }
    assert (
        {pair for pair, times in found.items() if times == 500}
        == {("hand", "link7"), ("leftfinger", "rightfinger")}
        <= masked
    )
    next_but_one = {tuple(sorted((f"link{i}", f"link{i + 2}"))) for i in range(6)}
    assert {pair for pair in found if pair in next_but_one} <= masked


def test_without_masked_pairs_few_random_poses_overlap(tmp_path: Path) -> None:
    found = overlapping(500, tmp_path / "panda.urdf")
    masked = {
        tuple(sorted((a.removeprefix("panda_"), b.removeprefix("panda_"))))
        for a, b in panda_description.ignored_pairs()
    }
    assert sum(times for pair, times in found.items() if pair not in masked) < 0.25 * 500


def test_masked_pairs_carry_the_prefix_and_leave_the_hand_out_when_there_is_none() -> None:
    assert ("left_link5", "left_link7") in panda_description.ignored_pairs("left")
    assert panda_description.ignored_pairs(hand=False) == [("panda_link5", "panda_link7")]
