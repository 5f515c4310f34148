"""Cases and implementations of the model suite: a further implementation of FrankaModel joins by one entry in
IMPLEMENTATIONS."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame, FrankaModel
from franka_hw_interface.transforms import FloatArray
from hric_core.geometry import transform_from_rpy

if TYPE_CHECKING:
    from libfranka_box import Arms


@functools.cache
def description(**arguments: object) -> str:
    return panda_description.load(meshes=False, collision=False, **arguments)


@dataclass(frozen=True)
class Case:
    """Situation of the arm in a test: mounting and hand of the URDF, and the configured payload and frames."""

    name: str
    hand: bool = True
    rpy: str = "0 0 0"
    fingers: str = "fixed"
    load: tuple[float, tuple[float, float, float], FloatArray] | None = None
    F_T_EE: FloatArray | None = None
    EE_T_K: FloatArray | None = None
    arm_id: str = "panda"
    inertials: str = "barycentric"

    def urdf(self) -> str:
        about = {name: getattr(self, name) for name in ("arm_id", "hand", "rpy", "fingers", "inertials")}
        return description(xyz="0.1 -0.2 0.3", **about)


PAYLOAD = (
    2.3,
    (0.03, -0.05, 0.12),
    np.array([[0.012, 0.001, -0.002], [0.001, 0.016, 0.0007], [-0.002, 0.0007, 0.009]]),
)
CASES = [
    Case("bare", hand=False),
    Case("hand"),
    Case("movable fingers, tilted", rpy="0.4 -0.7 1.2", fingers="prismatic"),
    Case(
        "payload and own frames, tilted, another arm_id",
        rpy="-1.1 0.3 0.2",
        load=PAYLOAD,
        arm_id="left",
        F_T_EE=transform_from_rpy((0.01, 0.02, 0.2), (0.3, -0.4, 0.5)),
        EE_T_K=transform_from_rpy((0.05, -0.03, 0.04), (-0.2, 0.1, 0.9)),
    ),
]


@pytest.fixture(scope="session")
def arms() -> Iterator[Arms]:
    """Yield libfranka connections to emulated control boxes."""
    from libfranka_box import Arms  # slow to import, and not for every test here

    made = Arms()
    yield made
    made.close()


def libfranka_panda(case: Case, arms: Arms) -> FrankaModel:
    from franka_real.libfranka_model import LibfrankaModel

    robot, model = arms.get("panda", case.hand)
    return LibfrankaModel.for_panda(model, robot.read_once(), gravity_base(case))


def libfranka_fr3(case: Case, arms: Arms) -> FrankaModel:
    from franka_real.libfranka_model import LibfrankaModel

    robot, model = arms.get("fr3", case.hand)
    return LibfrankaModel.for_fr3(model, robot.read_once(), case.urdf(), case.arm_id, gravity_base(case))


def gravity_base(case: Case) -> list[float]:
    """Return gravity in the base frame [m/s^2], which a libfranka without the arm's mounting pose does not give."""
    return KdlFrankaModel(case.urdf(), case.arm_id).gravity_base.tolist()


IMPLEMENTATIONS: dict[str, tuple[Callable[[Case, Arms], FrankaModel], float]] = {
    "kdl": (lambda case, _: KdlFrankaModel(case.urdf(), case.arm_id), 1e-9),
    "libfranka 0.9, Panda": (libfranka_panda, 1e-9),
    "libfranka 0.21, FR3": (libfranka_fr3, 1e-6),
}
"""How it is built, and how exact it must be: the FR3 tells its hand in single precision."""


class Oracle:
    """Model quantities computed by a second rigid-body library."""

    def __init__(self, case: Case) -> None:
        full = pin.buildModelFromXML(case.urdf())
        fingers = [full.getJointId(name) for name in full.names if "finger" in name]
        self.model = pin.buildReducedModel(full, fingers, np.zeros(full.nq)) if fingers else full
        arm, joint = case.arm_id, self.model.getJointId(f"{case.arm_id}_joint7")
        flange = self.model.frames[self.model.getFrameId(f"{arm}_link8")].placement
        if case.load is not None:
            mass, com, inertia = case.load
            self.model.appendBodyToJoint(joint, pin.Inertia(mass, np.array(com), inertia), flange)
        F_T_EE = (
            case.F_T_EE
            if case.F_T_EE is not None
            else transform_from_rpy((0, 0, 0.1034), (0, 0, -np.pi / 4))
            if case.hand
            else np.eye(4)
        )
        EE_T_K = np.eye(4) if case.EE_T_K is None else case.EE_T_K
        for name, T in (("EE", F_T_EE), ("K", F_T_EE @ EE_T_K)):
            self.model.addFrame(pin.Frame(name, joint, flange * pin.SE3(T), pin.FrameType.OP_FRAME))
        self.data = self.model.createData()
        pin.framesForwardKinematics(self.model, self.data, np.zeros(7))
        self.world_base = self.data.oMf[self.model.getFrameId(f"{arm}_link0")].copy()
        names = {f"joint{i}": f"{arm}_link{i}" for i in range(1, 8)} | {
            "flange": f"{arm}_link8",
            "end_effector": "EE",
            "stiffness": "K",
        }
        self.ids = {frame: self.model.getFrameId(names[frame.value]) for frame in FrankaFrame}

    def dynamics(self, q: FloatArray, dq: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return M, C dq and g."""
        M = np.triu(pin.crba(self.model, self.data, q))
        g = pin.computeGeneralizedGravity(self.model, self.data, q)
        return M + np.triu(M, 1).T, pin.nonLinearEffects(self.model, self.data, q, dq) - g, g.copy()

    def kinematics(self, q: FloatArray) -> dict[FrankaFrame, tuple[FloatArray, FloatArray, FloatArray]]:
        """Return pose, Jacobian in the base frame, and Jacobian in the frame itself."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        turn = np.kron(np.eye(2), self.world_base.rotation.T)
        found = {}
        for frame, i in self.ids.items():
            zero = turn @ pin.getFrameJacobian(self.model, self.data, i, pin.LOCAL_WORLD_ALIGNED)
            body = pin.getFrameJacobian(self.model, self.data, i, pin.LOCAL)
            found[frame] = (self.world_base.inverse() * self.data.oMf[i]).homogeneous, zero, body
        return found


def random_states(n: int, seed: int = 7) -> tuple[FloatArray, FloatArray]:
    """Return random legal joint positions and velocities, each of shape (n, 7)."""
    limits, rng = list(panda_description.joint_limits().values()), np.random.default_rng(seed)
    q = rng.uniform([joint.lower for joint in limits], [joint.upper for joint in limits], (n, 7))
    speed = np.array([joint.velocity for joint in limits])
    return q, rng.uniform(-speed, speed, (n, 7))


@pytest.fixture(params=[case.name for case in CASES])
def case(request: pytest.FixtureRequest) -> Case:
    return next(case for case in CASES if case.name == request.param)


@pytest.fixture(params=sorted(IMPLEMENTATIONS))
def implementation(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def tolerance(implementation: str) -> float:
    return IMPLEMENTATIONS[implementation][1]


@pytest.fixture
def model(implementation: str, case: Case, arms: Arms) -> FrankaModel:
    """Return a model configured as the case specifies."""
    built = IMPLEMENTATIONS[implementation][0](case, arms)
    if case.load is not None:
        built.set_load(*case.load)
    if case.F_T_EE is not None:
        built.set_ee(case.F_T_EE)
    if case.EE_T_K is not None:
        built.set_stiffness_frame(case.EE_T_K)
    return built


@pytest.fixture
def oracle_of(implementation: str) -> Callable[[Case], Oracle]:
    return lambda case: Oracle(replace(case, inertials="fr3") if "FR3" in implementation else case)


@pytest.fixture
def oracle(oracle_of: Callable[[Case], Oracle], case: Case) -> Oracle:
    return oracle_of(case)


@pytest.fixture
def states() -> Callable[[int], tuple[FloatArray, FloatArray]]:
    return random_states
