"""From paired points to the pose of the mocap frame, in the node's own services on a LocalNode."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Point, Pose, Quaternion
from std_msgs.msg import Header
from std_srvs.srv import TriggerRequest

from franka_msgs.msg import FrankaState
from hric_core.errors import CommandError
from hric_core.geometry import Pose as Placed
from hric_core.geometry import from_rotation_vector, transformed
from hric_core.geometry.poses import from_z_up, inverse
from hric_core.geometry.quaternions import difference
from hric_core.local.node import LocalNode
from hric_msgs.msg import MocapData, RigidBodyState
from mocap_natnet.node.calibrate import AVERAGED, CalibrateNode
from mocap_natnet.tracking.calibration import FrameCalibration, save

BASE = Placed((0.5, -0.3, 0.2), from_rotation_vector((0.1, -0.2, 1.0)))
PLACES = [(0.4, 0.0, 0.3), (0.5, 0.2, 0.4), (0.3, -0.2, 0.6), (0.6, 0.1, 0.2)]


def frame(position: tuple, valid: bool = True, frame_id: str = "mocap") -> MocapData:
    body = RigidBodyState("tool", 1, Pose(Point(*from_z_up("y", position)), Quaternion(w=1.0)), valid, 0.0)
    return MocapData(header=Header(frame_id=frame_id), rigid_bodies=[body])


class Bench:
    def __init__(self, folder: Path) -> None:
        self.node = LocalNode({"calibrate": {"file": str(folder / "base.yaml")}}, "/calibrate")
        CalibrateNode(self.node)
        self.frames = self.node.advertise("/hric/perception/mocap", MocapData)
        self.states = self.node.advertise("/franka_state_controller/franka_states", FrankaState)

    def stand(self, place: tuple, shift: float = 0.0) -> None:
        state = FrankaState()
        state.O_T_EE = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *place, 1]
        self.states.publish(state)
        x, y, z = transformed(inverse(BASE), place)
        for index in range(AVERAGED):
            self.frames.publish(frame((x + shift * index, y, z)))

    def call(self, name: str) -> tuple[bool, str]:
        answer = self.node.call(f"/calibrate/{name}", TriggerRequest())
        return answer.success, answer.message


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_paired_points_give_the_base_and_the_file_that_the_client_takes(bench: Bench, tmp_path: Path) -> None:
    for place in PLACES:
        bench.stand(place)
        assert bench.call("add")[0]
    done, text = bench.call("solve")
    assert done and "residual 0.00 mm" in text
    saved = yaml.safe_load((tmp_path / "base.yaml").read_text())
    assert saved["base_frame"] == "panda_link0"
    assert saved["base_from_mocap"]["xyz"] == pytest.approx(BASE.position, abs=1e-9)
    assert math.hypot(*difference(tuple(saved["base_from_mocap"]["xyzw"]), BASE.orientation)) < 1e-6


def test_what_cannot_be_a_pair_is_refused_in_words(bench: Bench) -> None:
    assert "state is not known" in bench.call("add")[1]
    bench.stand(PLACES[0], shift=1e-4)
    assert "still" in bench.call("add")[1]
    bench.frames.publish(frame(PLACES[0], valid=False))
    assert f"0 of {AVERAGED}" in bench.call("add")[1]
    bench.stand(PLACES[0])
    bench.frames.publish(frame(PLACES[0], frame_id="panda_link0"))
    assert "without base_frame" in bench.call("add")[1]
    bench.stand(PLACES[0])
    assert bench.call("add") == (True, "1 pairs")
    assert "three or more" in bench.call("solve")[1]
    assert bench.call("clear") == (True, "0 pairs")


def test_residuals_show_noise_and_the_bad_pair() -> None:
    random, calibration = np.random.default_rng(0), FrameCalibration()
    for place in random.uniform(-0.5, 0.5, (20, 3)):
        calibration.add(transformed(inverse(BASE), tuple(place)), tuple(place + 0.001 * random.standard_normal(3)))
    pose, rms, _ = calibration.solve()
    assert 0.001 < rms < 0.0025
    assert np.linalg.norm(np.subtract(pose.position, BASE.position)) < 0.003
    calibration.add((0.0, 0.0, 0.0), tuple(np.add(BASE.position, (0.1, 0.0, 0.0))))
    _, _, each = calibration.solve()
    assert int(np.argmax(each)) == 20


def test_a_file_that_cannot_be_written_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="nowhere"):
        save(tmp_path / "nowhere" / "base.yaml", BASE, "panda_link0", 0.0, 3)
    (tmp_path / "taken").mkdir()
    with pytest.raises(CommandError, match="taken"):
        save(tmp_path / "taken", BASE, "panda_link0", 0.0, 3)
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]
