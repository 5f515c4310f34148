"""What libfranka's own rate limiter lets pass must pass the box: the limiter of the unmodified client library is called
here."""

import ctypes
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.robot_state import RobotState
from franka_sim.box.kinematics import moved
from franka_sim.box.motion import MotionGenerator, make_generator
from franka_sim.box.requests import GeneratorMode, MotionCommand

READY = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]
REST = [0.0] * 7
LIMITS = franka_limits()
CLIENT = LIMITS.with_margins()
STEPS = 2500

Array = {n: type(f"Array{n}", (ctypes.Structure,), {"_fields_": [("values", ctypes.c_double * n)]}) for n in (6, 7, 16)}


def array(values: Any) -> Any:
    n = len(values)
    return Array[n]((ctypes.c_double * n)(*values))


class Limiter:
    """franka::limitRate of libfranka 0.9.2; std::array is passed and returned as a structure of doubles."""

    def __init__(self, library: ctypes.CDLL) -> None:
        arrays = "RKSt5arrayIdLm7EE"
        self._velocity = getattr(library, f"_ZN6franka9limitRateE{arrays}{'S3_' * 5}")
        self._position = getattr(library, f"_ZN6franka9limitRateE{arrays}{'S3_' * 6}")
        self._twist = library._ZN6franka9limitRateEddddddRKSt5arrayIdLm6EES3_S3_
        self._pose = library._ZN6franka9limitRateEddddddRKSt5arrayIdLm16EES3_RKS0_IdLm6EES6_
        self._elbow = library._ZN6franka9limitRateEddddddd
        self._velocity.restype = self._position.restype = Array[7]
        self._twist.restype, self._pose.restype, self._elbow.restype = Array[6], Array[16], ctypes.c_double
        self._joint = [array(x) for x in (CLIENT.velocity, CLIENT.acceleration, CLIENT.jerk)]
        limits = (CLIENT.translation, CLIENT.rotation)
        self._cartesian = [
            ctypes.c_double(x) for limit in limits for x in (limit.velocity, limit.acceleration, limit.jerk)
        ]

    @staticmethod
    def _call(function: Any, first: list[Any], *values: list[float]) -> list[float]:
        result = function(
            *[x if isinstance(x, ctypes.c_double) else ctypes.byref(x) for x in first],
            *[ctypes.byref(array(x)) for x in values],
        )
        return list(result.values)

    def velocity(self, dq: list[float], state: RobotState) -> list[float]:
        return self._call(self._velocity, self._joint, dq, state.dq_d, state.ddq_d)

    def position(self, q: list[float], state: RobotState) -> list[float]:
        return self._call(self._position, self._joint, q, state.q_d, state.dq_d, state.ddq_d)

    def twist(self, v: list[float], state: RobotState) -> list[float]:
        return self._call(self._twist, self._cartesian, v, state.O_dP_EE_c, state.O_ddP_EE_c)

    def pose(self, T: list[float], state: RobotState) -> list[float]:
        return self._call(self._pose, self._cartesian, T, state.O_T_EE_c, state.O_dP_EE_c, state.O_ddP_EE_c)

    def elbow(self, q3: float, state: RobotState) -> float:
        limit = CLIENT.elbow
        values = (
            limit.velocity,
            limit.acceleration,
            limit.jerk,
            q3,
            state.elbow_c[0],
            state.delbow_c[0],
            state.ddelbow_c[0],
        )
        return float(self._elbow(*map(ctypes.c_double, values)))


@pytest.fixture(scope="module")
def limiter() -> Limiter:
    spec = importlib.util.find_spec("panda_py")
    if spec is None or spec.origin is None:
        pytest.skip("panda-python, which brings libfranka 0.9.2, is not installed")
    (library,) = (Path(spec.origin).parents[1] / "panda_python.libs").glob("libfranka*")
    return Limiter(ctypes.CDLL(str(library)))


@pytest.fixture(scope="module")
def model() -> KdlFrankaModel:
    return KdlFrankaModel(panda_description.load(meshes=False, collision=False), "panda")


def started(kind: GeneratorMode, model: KdlFrankaModel, q: list[float] = READY) -> tuple[MotionGenerator, RobotState]:
    generator, state = make_generator(kind, model, LIMITS), RobotState()
    state.q_d[:] = q
    assert generator.start(state) == frozenset()
    return generator, state


def command(**fields: Any) -> MotionCommand:
    return MotionCommand(
        **({"q": REST, "dq": REST, "O_T_EE": [0.0] * 16, "O_dP_EE": [0.0] * 6, "elbow": None, "tau": REST} | fields)
    )


def losses(rng: np.random.Generator, longest: int) -> list[bool]:
    """Return which packets are lost: none at first, then now and then up to `longest` consecutive ones."""
    lost = [False] * 50
    while len(lost) < STEPS:
        lost += [False] * int(rng.integers(1, 40)) + [True] * int(rng.integers(0, longest + 1))
    return lost[:STEPS]


def echoed(state: RobotState, single: bool) -> RobotState:
    """The state as the client sees it: protocol 10 carries 32-bit floats."""
    if not single:
        return state
    seen = state.snapshot()
    for name in ("q_d", "dq_d", "ddq_d", "O_T_EE_c", "O_dP_EE_c", "O_ddP_EE_c"):
        setattr(seen, name, np.array(getattr(state, name), dtype=np.float32).astype(float).tolist())
    return seen


@pytest.mark.parametrize("longest", [0, 1, 3])
@pytest.mark.parametrize("single", [False, True], ids=["f64", "f32"])
def test_joint_positions_from_the_limiter_pass_whatever_is_wished_and_lost(limiter, model, longest, single) -> None:
    rng = np.random.default_rng(longest)
    generator, state = started(GeneratorMode.JOINT_POSITION, model)
    wish, peak = READY, np.zeros(7)
    for step, lost in enumerate(losses(rng, longest)):
        if step % 137 == 0:
            wish = rng.uniform(np.array(LIMITS.lower) + 0.3, np.array(LIMITS.upper) - 0.3).tolist()
        q = limiter.position(wish, echoed(state, single))
        q = np.clip(q, LIMITS.lower, LIMITS.upper).tolist()
        assert generator.advance(None if lost else command(q=q)) == frozenset(), f"step {step}"
        peak = np.maximum(peak, np.abs(state.dq_d))
    assert (peak > 0.5 * np.array(LIMITS.velocity)).all()


@pytest.mark.parametrize("longest", [0, 1, 3])
@pytest.mark.parametrize("single", [False, True], ids=["f64", "f32"])
def test_joint_velocities_from_the_limiter_pass_whatever_is_wished_and_lost(limiter, model, longest, single) -> None:
    rng = np.random.default_rng(10 + longest)
    generator, state = started(GeneratorMode.JOINT_VELOCITY, model)
    middle, wish = (np.array(LIMITS.lower) + LIMITS.upper) / 2, np.zeros(7)
    peak = np.zeros(7)
    for step, lost in enumerate(losses(rng, longest)):
        if step % 97 == 0:
            wish = rng.choice([1.0, 2.0], 7) * np.where(np.array(state.q_d) < middle, 3.0, -3.0)
        assert (
            generator.advance(None if lost else command(dq=limiter.velocity(wish.tolist(), echoed(state, single))))
            == frozenset()
        ), f"step {step}"
        peak = np.maximum(peak, np.abs(state.dq_d))
    assert (peak > 0.5 * np.array(LIMITS.velocity)).all()


def gentle(rng: np.random.Generator) -> np.ndarray:
    """A twist that the joints can follow, 6 floats."""
    return np.array([*rng.uniform(-0.2, 0.2, 3), *rng.uniform(-0.4, 0.4, 3)])


@pytest.mark.parametrize("longest", [0, 1, 3])
@pytest.mark.parametrize("single", [False, True], ids=["f64", "f32"])
def test_cartesian_velocities_from_the_limiter_pass_the_cartesian_checks_whatever_is_wished_and_lost(
    limiter, model, longest, single
) -> None:
    # The joints are left out here: the limiter knows nothing of what a Cartesian motion asks of them.
    rng = np.random.default_rng(20 + longest)
    generator, state = started(GeneratorMode.CARTESIAN_VELOCITY, model)
    generator._take_joints = lambda *motion: follow_without_joints(generator, *motion)  # type: ignore[attr-defined]
    wish, peak = np.zeros(6), np.zeros(2)
    for step, lost in enumerate(losses(rng, longest)):
        if step % 97 == 0:
            wish = rng.uniform(-3.0, 3.0, 6)
        errors = generator.advance(
            None if lost else command(O_dP_EE=limiter.twist(wish.tolist(), echoed(state, single)))
        )
        assert errors == frozenset(), f"step {step}"
        peak = np.maximum(peak, np.linalg.norm(np.reshape(state.O_dP_EE_c, (2, 3)), axis=1))
    assert peak[0] > 0.9 * CLIENT.translation.velocity and peak[1] > 0.9 * CLIENT.rotation.velocity


@pytest.mark.parametrize("longest", [0, 1, 3])
@pytest.mark.parametrize("single", [False, True], ids=["f64", "f32"])
def test_poses_from_the_limiter_pass_the_cartesian_checks_whatever_is_wished_and_lost(
    limiter, model, longest, single
) -> None:
    rng = np.random.default_rng(30 + longest)
    generator, state = started(GeneratorMode.CARTESIAN_POSITION, model)
    generator._take_joints = lambda *motion: follow_without_joints(generator, *motion)  # type: ignore[attr-defined]
    twist, peak = np.zeros(6), np.zeros((2, 2))
    for step, lost in enumerate(losses(rng, longest)):
        if step % 137 == 0:
            twist = below_top_speed(rng)
        seen = echoed(state, single)
        wish = moved(seen.O_T_EE_c, twist, 0.001)
        errors = generator.advance(None if lost else command(O_T_EE=limiter.pose(wish, seen)))
        assert errors == frozenset(), f"step {step}"
        peak = np.maximum(peak, np.linalg.norm(np.reshape([state.O_dP_EE_c, state.O_ddP_EE_c], (2, 2, 3)), axis=2))
    assert (peak > [[1.5, 1.8], [12.8, 24.5]]).all()


def follow_without_joints(
    generator: Any, T: list[float], twist: list[float], acceleration: list[float]
) -> frozenset[str]:
    generator._T, generator._twist, generator._acceleration = T, twist, acceleration
    generator._publish()
    return frozenset()


def below_top_speed(rng: np.random.Generator) -> np.ndarray:
    """A twist of any direction at 0.9 of the limiter's highest speeds: above them it does not limit the acceleration,
    see rate_limits.py."""
    linear, angular = rng.normal(size=(2, 3))
    linear *= 0.9 * CLIENT.translation.velocity / np.linalg.norm(linear)
    angular *= 0.9 * CLIENT.rotation.velocity / np.linalg.norm(angular)
    return np.concatenate([linear, angular])


@pytest.mark.parametrize(("longest", "single"), [(0, False), (3, False), (3, True)])
@pytest.mark.parametrize("elbow", [False, True], ids=["elbow free", "elbow commanded"])
def test_smooth_poses_pass_with_their_joints_whatever_is_lost(limiter, model, longest, single, elbow) -> None:
    rng = np.random.default_rng(40 + longest)
    generator, state = started(GeneratorMode.CARTESIAN_POSITION, model)
    start = state.O_T_EE_c[:]
    for step, lost in enumerate(losses(rng, longest)):
        swing = 0.5 * (1.0 - np.cos(2.0 * np.pi * step / 1250))
        wish = start[:]
        wish[12], wish[13], wish[14] = start[12] + 0.1 * swing, start[13] - 0.08 * swing, start[14] - 0.1 * swing
        seen = echoed(state, single)
        q3 = (limiter.elbow(0.3 * swing, seen), -1.0) if elbow else None
        errors = generator.advance(None if lost else command(O_T_EE=limiter.pose(wish, seen), elbow=q3))
        assert errors == frozenset(), f"step {step}"
    assert np.abs(np.array(state.O_T_EE_c) - wish).max() < 1e-2


@pytest.mark.parametrize("longest", [0, 3])
def test_gentle_twists_from_the_limiter_pass_with_their_joints(limiter, model, longest) -> None:
    rng = np.random.default_rng(50 + longest)
    generator, state = started(GeneratorMode.CARTESIAN_VELOCITY, model)
    wish, middle, filtered = np.zeros(6), np.zeros(6), np.zeros(6)
    for step, lost in enumerate(losses(rng, longest)):
        if step % 300 == 0:
            wish = gentle(rng) if step % 600 == 0 else -wish
        middle += 0.01 * (wish - middle)
        filtered += 0.01 * (middle - filtered)
        errors = generator.advance(None if lost else command(O_dP_EE=limiter.twist(filtered.tolist(), state)))
        assert errors == frozenset(), f"step {step}"
