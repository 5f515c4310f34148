"""panda-python's own calls, unchanged, on the emulated arm: motions, controllers in C++, contexts, errors, logging,
model, hand."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fci_peer import control_box

USER = Path(__file__).parent / "panda_py_user.py"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with control_box("--no-collision", "--real-time-factor", "0") as (ip, _):
        yield ip


def run(address: str, name: str) -> dict[str, Any]:
    """One of the user's programs in a process of its own; what it found."""
    done = subprocess.run(
        [sys.executable, str(USER), address, name], capture_output=True, text=True, timeout=60.0, check=False
    )
    assert done.returncode == 0, f"the user's program failed:\n{done.stdout}\n{done.stderr}"
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def test_joint_motions_end_where_requested(address: str) -> None:
    for name, (success, distance) in run(address, "joint_motions").items():
        assert success and distance < 1e-3, (
            name
        )  # panda-python ends at 1e-3 rad/s, so a little on the way; 3e-4 rad measured


def test_pose_motions_end_within_panda_pythons_own_threshold_and_exactly_without_its_null_space(address: str) -> None:
    # The usual gains end 7 mm and 0.08 rad off their goal: see the next test for why it is panda-python and not the
    # box. Its damping 2 sqrt(K) is critical for 1 kg alone: with this arm the slowest oscillation has ratio 0.4 and
    # decays at 2.2/s, but move_to_pose ends a second after its path in any case, still 2.6 mm off. So the goal is held
    # for another second.
    found = run(address, "pose_motions")
    assert all(success for success, _, _ in found.values())
    distances, angles = ({name: values[k] for name, values in found.items()} for k in (1, 2))
    assert distances["usual"] < 0.02 and angles["usual"] < 0.1, "its success_threshold and orientation_threshold"
    for name in ("no null space", "waypoints"):
        assert distances[name] < 1e-3 and angles[name] < 1e-2, name  # 0.11 mm and 2.2 mrad measured
    assert distances["no null space"] < distances["soft null space"] < 0.3 * distances["usual"]


def test_where_panda_pythons_impedance_rests_its_own_law_is_in_balance(address: str) -> None:
    # Its null space projection I - J' (J')^+ takes a damped pseudoinverse, s / (s^2 + 0.2^2), so a part of the pull
    # towards the start position works against the spring at the end effector. The arm rests where both are equal: the
    # box applied the torques that it was sent and no others.
    found = run(address, "resting_pose")
    J, pose, goal = np.array(found["jacobian"]).reshape(7, 6).T, np.array(found["pose"]), np.array(found["goal"])
    spring = J.T @ -(np.diag([800.0] * 3 + [40.0] * 3) @ pose_error(pose, goal))
    u, s, vt = np.linalg.svd(J.T, full_matrices=False)
    pull = (np.eye(7) - J.T @ (vt.T * (s / (s**2 + 0.04)) @ u.T)) @ (15.0 * (np.array(found["q_null"]) - found["q"]))
    assert max(map(abs, found["dq"])) < 1e-5
    assert np.linalg.norm((pose - goal)[:3, 3]) > 1e-3
    assert np.abs(spring).max() > 0.2
    assert np.abs(spring + pull).max() < 1e-3 * np.abs(spring).max()


def pose_error(pose: Any, goal: Any) -> Any:
    """Position and vector part of the quaternion of the rotation from the goal, in base axes, shape (6,) [m], [1]."""
    R = pose[:3, :3] @ goal[:3, :3].T
    vector = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (2.0 * np.sqrt(1.0 + np.trace(R)))
    return np.concatenate([(pose - goal)[:3, 3], vector])


def test_joint_controllers_bring_the_arm_to_their_setpoints(address: str) -> None:
    found = run(address, "joint_controllers")
    assert found["position"] < 1e-4 and not found["moving"]
    assert found["integral"] == pytest.approx([0.0, 0.0, 0.0, 0.2, 0.0, 0.0, -0.2], abs=0.01)
    assert found["velocity"] < 1e-3


def test_controllers_of_the_end_effector_bring_it_there_and_push_it(address: str) -> None:
    found = run(address, "task_controllers")
    distance, angle = found["impedance"]
    assert distance < 1e-3 and angle < 5e-3
    x, y, z = found["force"]
    assert z < -0.05 and abs(y) < 0.01 and abs(x) < abs(z)


def test_a_torque_accelerates_by_the_inertia_and_the_log_has_each_millisecond(address: str) -> None:
    found = run(address, "torque_and_log")
    assert found["measured"] == pytest.approx(found["expected"], rel=0.01)
    assert found["steps"] == [1.0]
    assert {"q", "dq", "tau_J", "O_T_EE", "O_F_ext_hat_K", "control_command_success_rate"} <= set(found["fields"])


def test_a_context_paces_a_users_loop(address: str) -> None:
    found = run(address, "context")
    assert found["ticks"] > 100 and found["way"] == pytest.approx(0.1, abs=0.01)
    assert found["distance"] < 1e-3


def test_errors_are_raised_by_name_and_recovered_from(address: str) -> None:
    found = run(address, "errors")
    assert "joint_velocity_violation" in found["fast"] and "reflex" in found["fast"]
    assert "threshold" in found["threshold"]
    assert found["fast mode"].endswith("kReflex") and found["threshold mode"].endswith("kIdle")
    for name in ("fast", "threshold"):
        assert found[f"{name} recovered"].endswith("kIdle")
        success, distance = found[f"{name} after"]
        assert success and distance < 1e-3


def test_teaching_the_model_and_the_hand(address: str) -> None:
    found = run(address, "the_rest")
    assert found["teaching"]
    assert found["pose"] < 1e-9 and found["gravity"] < 1e-2
    homed, went, width, grasped, stopped = found["hand"]
    assert homed and went and width == pytest.approx(0.04, abs=1e-9) and not grasped and stopped
