"""A person who walks: where they are comes from their recorded root."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from known_bags import Bag, ball_urdf, header, joints, made, nearest, upright

from hric_assessment.ergonomics.muscle_load import load_of, motion_of
from hric_assessment.verdict import Verdict, assess, opened
from hric_bags.records.human_record import HumanRecord
from hric_bags.records.root_record import RootRecord
from hric_core.geometry import Pose
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_human.body import Body, describe
from hric_human.muscles.after_run import CUTOFF
from hric_human.muscles.choose import find
from hric_human.participant.settings import HumanSettings, MuscleSettings

SPEED, BEGIN = 0.8, 1.6
"""The person passes the ball that stands: [m/s], [m]."""


def body_of(parts: str) -> Body:
    return describe(HumanSettings.of({"parts": parts}, "human").person)


def still_arm(bag: Bag, times: np.ndarray) -> None:
    bag.write("/robot_description", "std_msgs/msg/String", 0.0, data=ball_urdf())
    for k in range(0, len(times) - 1, 20):
        rows: dict[str, Any] = dict.fromkeys(("position", "velocity", "effort", "command_raw", "command"), np.zeros(20))
        about = {"joint_names": ["rail"], "command_interface": ["none"], "first_cycle": k, "n_cycles": 20}
        bag.write("/control_log", "hric_msgs/msg/ControlLog", float(times[k]), **about, time=times[k : k + 20], **rows)


def walks(path: Path, body: Body, times: np.ndarray, frame: str, floor: float | None) -> Verdict:
    """Move the person past the ball, in a frame that is at x = floor [m] in the world; None: it is not recorded."""
    with Bag(path) as bag:
        still_arm(bag, times)
        upright(bag, 1.4, [] if floor is None else [("world", frame, floor)])
        joints(bag, times[::20], dict.fromkeys(body.joints, 0.0))
        turn = made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        for time in times[::10].tolist():
            place = made("geometry_msgs/msg/Point", x=BEGIN - SPEED * time - (floor or 0.0), y=0.0, z=1.4)
            pose = made("geometry_msgs/msg/Pose", position=place, orientation=turn)
            bag.write("/hric/human/root", "geometry_msgs/msg/PoseStamped", time, header=header(time, frame), pose=pose)
    return assess(opened(str(path)))


@pytest.mark.parametrize(("frame", "floor"), [("world", None), ("lab", 5.0)])
def test_the_distance_from_a_standing_arm_is_that_of_their_recorded_way(
    tmp_path: Path, frame: str, floor: float | None
) -> None:
    """Only the distance between them counts."""
    body, times = body_of("right_arm"), np.arange(0.0, 4.0005, 0.001)
    (found,) = (
        one for one in walks(tmp_path / "a.bag", body, times, frame, floor).findings if one.group == "separation"
    )
    smallest, at = nearest(body, SPEED * times - BEGIN)
    assert found.values["smallest distance [m]"] == pytest.approx(smallest, abs=1e-5)
    assert found.values["when [s]"] == pytest.approx(times[at], abs=2e-3)
    assert "/hric/human/root" in found.signals


def test_a_way_in_a_frame_that_is_not_in_the_world_has_no_distance(tmp_path: Path) -> None:
    body, times = body_of("right_arm"), np.arange(0.0, 4.0005, 0.001)
    verdict = walks(tmp_path / "a.bag", body, times, "lab", None)
    assert not [one for one in verdict.findings if one.group == "separation"]
    assert next(one for one in verdict.conclusions if one.question == "distance").reply == "unknown"


def test_between_two_samples_a_root_turns_the_shorter_way_and_has_a_rotation() -> None:
    q = np.array([0.0, 0.0, np.sin(0.2), np.cos(0.2)])
    root = RootRecord(np.array([0.0, 1.0]), np.vstack([[0.0, 0.0, 1.0, *q], [2.0, 0.0, 1.0, *-q]]))
    T = root.transforms(np.array([-1.0, 0.5, 3.0]))
    assert np.allclose(T[:, :3, :3], rotation_from_quaternion(q.tolist()))
    assert T[:, 0, 3].tolist() == [0.0, 1.0, 2.0]
    assert np.allclose(RootRecord.still(Pose((1.0, 2.0, 3.0))).transforms(np.zeros(1))[0, :3, 3], [1.0, 2.0, 3.0])


def test_muscles_of_who_speeds_up_carry_what_gravity_that_leans_would_load_on_them() -> None:
    """A frame that accelerates with a is as one at rest in which everything falls with g - a."""
    body, a, g = body_of("right_arm"), 0.7, 9.80665
    time = np.arange(0.0, 2.0, 0.01)
    n, count, none = len(time), len(body.joints), np.zeros((1, len(body.joints)))
    q = np.tile(np.linspace(0.1, 0.5, count), (n, 1))
    pose = np.zeros((n, 7))
    pose[:, 0], pose[:, 2], pose[:, 6] = 0.5 * a * time**2, 1.4, 1.0
    still = HumanRecord(tuple(body.joints), time, q, time[:1], none, none, {})
    walks = HumanRecord(tuple(body.joints), time, q, time[:1], none, none, {}, root=RootRecord(time, pose))
    anatomy, root = find(MuscleSettings().anatomy, "anatomy"), Pose((0.0, 0.0, 1.4))
    found = []
    for record, gravity in ((walks, (0.0, 0.0, -g)), (still, (-a, 0.0, -g))):
        motion, moved = motion_of(record, list(body.joints), root, CUTOFF)
        found.append(load_of(body, anatomy, moved, motion, gravity=gravity))
    middle = slice(40, -40)  # where the filter has no ends
    assert np.allclose(found[0].torque[middle], found[1].torque[middle], atol=1e-3)
    assert np.abs(found[0].torque[middle] - found[0].torque[0]).max() < np.abs(found[0].torque).max()
