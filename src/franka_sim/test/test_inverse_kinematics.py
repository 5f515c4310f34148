"""Kinematics of the control box against pinocchio, and the inverse kinematics with elbow."""

import itertools

import numpy as np
import pinocchio
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_sim.box.config import motion_parameters
from franka_sim.box.inverse_kinematics import ELBOW_JOINT, ELBOW_ROW, ElbowInverseKinematics, Newton, elbow_side
from franka_sim.box.kinematics import ArmKinematics, twist_between

READY = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]
LIMITS = franka_limits()
POSES = 200
URDF = panda_description.load(meshes=False, collision=False)


class Oracle:
    """Pose and Jacobian of a link by pinocchio."""

    def __init__(self) -> None:
        self.model = pinocchio.buildModelFromXML(URDF)
        self.data = self.model.createData()
        self.arm = [self.model.joints[self.model.getJointId(f"panda_joint{i}")].idx_q for i in range(1, 8)]

    def __call__(self, q: list[float], link: str) -> tuple[np.ndarray, np.ndarray]:
        full = pinocchio.neutral(self.model)
        full[self.arm] = q
        pinocchio.computeJointJacobians(self.model, self.data, full)
        pinocchio.updateFramePlacements(self.model, self.data)
        base = self.data.oMf[self.model.getFrameId("panda_link0")].inverse()
        frame = self.model.getFrameId(link)
        J = pinocchio.getFrameJacobian(self.model, self.data, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        R = np.kron(np.eye(2), base.rotation)
        return (base * self.data.oMf[frame]).homogeneous, R @ J[:, self.arm]


@pytest.fixture(scope="module")
def oracle() -> Oracle:
    return Oracle()


@pytest.fixture
def model() -> KdlFrankaModel:
    return KdlFrankaModel(URDF, "panda")


def legal_poses(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(LIMITS.lower, LIMITS.upper, (n, 7))


def columns(T: np.ndarray) -> list[float]:
    return T.T.ravel().tolist()


def test_pose_and_jacobian_of_the_hand_are_pinocchios(model, oracle) -> None:
    kinematics = ArmKinematics(model)
    for q in legal_poses(POSES):
        placement = kinematics.end_effector(q.tolist())
        T, J = oracle(q, "panda_hand_tcp")
        np.testing.assert_allclose(placement.T, columns(T), atol=1e-13)
        np.testing.assert_allclose(placement.jacobian(), J, atol=1e-13)


def test_a_changed_end_effector_and_stiffness_frame_count_after_update(model, oracle) -> None:
    kinematics = ArmKinematics(model)
    F_T_EE, EE_T_K = np.eye(4), np.eye(4)
    F_T_EE[:3, 3], EE_T_K[:3, 3] = (0.01, 0.02, 0.2), (0.0, 0.05, 0.03)
    EE_T_K[:3, :3] = pinocchio.exp3(np.array([0.1, -0.2, 0.3]))
    model.set_ee(F_T_EE)
    model.set_stiffness_frame(EE_T_K)
    T_flange, _ = oracle(READY, "panda_link8")
    before = kinematics.end_effector(READY).T
    kinematics.update()
    np.testing.assert_allclose(kinematics.end_effector(READY).T, columns(T_flange @ F_T_EE), atol=1e-13)
    np.testing.assert_allclose(kinematics.stiffness_frame(READY).T, columns(T_flange @ F_T_EE @ EE_T_K), atol=1e-13)
    assert np.abs(np.subtract(before, kinematics.end_effector(READY).T)).max() > 0.01


def test_the_solution_has_the_requested_pose_by_pinocchio_and_the_requested_elbow(model, oracle) -> None:
    inverse, rng, found = ElbowInverseKinematics(model, motion_parameters()), np.random.default_rng(1), 0
    for q in legal_poses(POSES, seed=1):
        J = oracle(q, "panda_hand_tcp")[1]
        if np.linalg.cond(np.vstack([J, np.eye(7)[2]])) > 100.0:
            continue
        T, _ = oracle(q, "panda_hand_tcp")
        solution = inverse.solve(columns(T), float(q[2]), q + rng.uniform(-0.01, 0.01, 7))
        assert solution is not None
        found += 1
        np.testing.assert_allclose(oracle(solution, "panda_hand_tcp")[0], T, atol=1e-10)
        assert solution[2] == pytest.approx(q[2], abs=1e-10)
        # Where the pose leaves one solution nearby, it is the one we began from.
        np.testing.assert_allclose(solution, q, atol=1e-8)
    assert found > POSES / 2


def test_moving_the_elbow_keeps_the_pose_and_moves_joint_3(model, oracle) -> None:
    inverse = ElbowInverseKinematics(model, motion_parameters())
    T, _ = oracle(READY, "panda_hand_tcp")
    q = READY
    for q3 in np.linspace(0.0, 0.6, 300):
        solution = inverse.solve(columns(T), q3, q)
        assert solution is not None
        q = solution
    np.testing.assert_allclose(oracle(q, "panda_hand_tcp")[0], T, atol=1e-10)
    assert q[2] == pytest.approx(0.6, abs=1e-10)
    assert q[0] < -1.0


def test_an_elbow_that_the_pose_does_not_allow_has_no_solution(model, oracle) -> None:
    # At the ready pose joint 3 turns back at 0.65 rad when the elbow swings further out.
    inverse = ElbowInverseKinematics(model, motion_parameters())
    assert inverse.solve(columns(oracle(READY, "panda_hand_tcp")[0]), 0.8, READY) is None


def test_a_pose_out_of_reach_has_no_solution(model) -> None:
    inverse = ElbowInverseKinematics(model, motion_parameters())
    T = ArmKinematics(model).end_effector(READY).T
    T[12] = 2.0
    assert inverse.solve(T, 0.0, READY) is None
    inverse.begin(READY)
    assert inverse.follow(T, 0.0, READY, READY) is None


def test_a_free_elbow_stays_where_it_is_and_the_path_is_repeatable(model, oracle) -> None:
    inverse = ElbowInverseKinematics(model, motion_parameters())
    T, _ = oracle(READY, "panda_hand_tcp")
    inverse.begin(READY)
    q, q3 = READY, []
    for step in range(2000):
        goal = T.copy()
        goal[:3, 3] += [0.1 * np.sin(np.pi * step / 1000), 0.1 * (1 - np.cos(np.pi * step / 1000)), 0.0]
        solution = inverse.follow(columns(goal), 0.0, q, q)
        assert solution is not None
        q = solution
        q3.append(q[2])
    assert np.abs(q3).max() < 2e-4
    np.testing.assert_allclose(q, READY, atol=2e-3)


def test_a_free_elbow_lets_go_where_holding_it_would_need_fast_joints(model, oracle) -> None:
    # A legal pose at which the self-motion hardly moves joint 3.
    parameters = motion_parameters()
    poses = legal_poses(3000, seed=3)
    kinematics = ArmKinematics(model)
    parts = [np.linalg.svd(kinematics.end_effector(q.tolist()).jacobian()) for q in poses]
    candidates = [q for q, (_, s, rows) in zip(poses, parts, strict=True) if s[-1] > 0.1 and abs(rows[-1][2]) < 0.01]
    assert candidates
    for q in candidates:
        inverse = ElbowInverseKinematics(model, parameters)
        inverse.begin(q.tolist())
        T = np.reshape(kinematics.end_effector(q.tolist()).T, (4, 4)).T
        T[0, 3] += 1e-4
        solution = inverse.follow(columns(T), float(q[2]), q.tolist(), q.tolist())
        assert solution is not None
        np.testing.assert_allclose(oracle(solution, "panda_hand_tcp")[0], T, atol=1e-10)
        least = 1e-4 / 0.1
        assert np.abs(np.subtract(solution, q)).max() < (1.0 + 1.0 / (2.0 * parameters.elbow_damping)) * least


def test_the_side_of_the_elbow_flips_with_joint_4_where_libfranka_says() -> None:
    assert elbow_side([0.0, 0.0, 0.0, -0.46, 0.0, 0.0, 0.0]) == 1.0
    assert elbow_side([0.0, 0.0, 0.0, -0.47, 0.0, 0.0, 0.0]) == -1.0


class NumpyNewton:
    """Newton's method by numpy; arguments as `Newton`'s."""

    def __init__(self, kinematics: ArmKinematics, tolerance: float, steps: int) -> None:
        self._kinematics, self._tolerance, self._steps = kinematics, tolerance, steps

    def solve(self, T: list[float], row: list[float], q3: float | None, guess: list[float]) -> list[float] | None:
        q = np.array(guess)
        for _ in range(self._steps + 1):
            placement = self._kinematics.end_effector(q.tolist())
            error = [*rotation_vector_twist(placement.T, T), 0.0 if q3 is None else q3 - q[ELBOW_JOINT]]
            if np.abs(error).max() <= self._tolerance:
                return q.tolist()
            step = np.linalg.solve(np.vstack([placement.jacobian(), row]), error)
            if np.abs(step).max() > 0.5:
                return None
            q = q + step
        return None

    def first_step(self, T: list[float], row: list[float], guess: list[float]) -> tuple[list[float], list[float]]:
        placement = self._kinematics.end_effector(guess)
        matrix = np.vstack([placement.jacobian(), row])
        direction = np.linalg.solve(matrix, [0.0] * 6 + [1.0])
        step = np.linalg.solve(matrix, [*rotation_vector_twist(placement.T, T), 0.0])
        return (guess + step).tolist(), (direction / np.linalg.norm(direction)).tolist()


def rotation_vector_twist(T_from: list[float], T_to: list[float]) -> np.ndarray:
    """The twist from one pose to the other within a second by pinocchio's logarithm."""
    a, b = (np.reshape(T, (4, 4)).T for T in (T_from, T_to))
    return np.concatenate([b[:3, 3] - a[:3, 3], pinocchio.log3(b[:3, :3] @ a[:3, :3].T)])


def test_newtons_method_gives_the_joints_that_numpy_gives(model) -> None:
    kinematics = ArmKinematics(model)
    compiled, plain = Newton(kinematics, 1e-12, 5), NumpyNewton(kinematics, 1e-12, 5)
    rng, met = np.random.default_rng(4), 0
    for q in legal_poses(POSES, seed=4).tolist():
        T, guess = kinematics.pose([x + dx for x, dx in zip(q, rng.uniform(-1e-4, 1e-4, 7), strict=True)]), q
        for row, q3 in ((ELBOW_ROW, q[2]), (rng.normal(size=7).tolist(), None)):
            expected, found = plain.solve(T, row, q3, guess), compiled.solve(T, row, q3, guess)
            assert (expected is None) == (found is None)
            if expected is not None and np.linalg.cond(np.vstack([kinematics.end_effector(q).jacobian(), row])) < 100.0:
                np.testing.assert_allclose(found, expected, atol=1e-11)
                np.testing.assert_allclose(
                    compiled.first_step(T, row, guess), plain.first_step(T, row, guess), atol=1e-11
                )
                met += 1
    assert met > POSES / 2


def test_twists_are_pinocchios_logarithm_up_to_90_degrees_and_have_the_right_angle_beyond(model) -> None:
    kinematics, beyond = ArmKinematics(model), 0
    for a, b in itertools.pairwise(kinematics.pose(q) for q in legal_poses(POSES, seed=5).tolist()):
        expected, found = rotation_vector_twist(a, b) / 0.001, np.array(twist_between(a, b, 0.001))
        angle = float(np.linalg.norm(expected[3:]))
        if angle < 0.5 * np.pi / 0.001:
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
        else:
            np.testing.assert_allclose(found, [*expected[:3], angle, 0.0, 0.0], rtol=1e-9, atol=1e-9)
            beyond += 1
    assert 10 < beyond < POSES - 10


@pytest.mark.parametrize("arguments", [([0.0] * 6,), ([0.0] * 6 + ["x"],), (None,)])
def test_compiled_kinematics_refuse_what_is_not_seven_numbers(model, arguments) -> None:
    with pytest.raises((ValueError, TypeError)):
        ArmKinematics(model).pose(*arguments)
