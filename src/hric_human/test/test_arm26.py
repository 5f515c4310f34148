"""Static optimisation and joint contact forces against OpenSim's own tools, on its arm26 with its real paths.

Both are given one motion and so the same joint torques. OpenSim's splines spoil a tenth of a second at both ends.
"""

import numpy as np
import pytest
from arm26_model import GRAVITY, JOINTS, Arm26, OpenSimRun

from hric_core.geometry import FloatArray, Pose
from hric_human.muscles.joint_contact import JointContact
from hric_human.muscles.static_optimization import StaticOptimization

FIRST, LAST = 0.2, 0.8


@pytest.fixture(scope="module")
def arm() -> Arm26:
    return Arm26()


@pytest.fixture(scope="module")
def run(arm: Arm26, tmp_path_factory: pytest.TempPathFactory) -> OpenSimRun:
    """The hand comes up within a second and the elbow bends by 90 deg, as a minimum-jerk motion."""
    time = np.linspace(0.0, 1.0, 121)
    share = 10.0 * time**3 - 15.0 * time**4 + 6.0 * time**5
    q = np.stack([0.15 * share, 0.1 + 1.5 * share], axis=1)
    return OpenSimRun(tmp_path_factory.mktemp("arm26"), arm.names, time, q)


def torque(arm: Arm26, run: OpenSimRun) -> FloatArray:
    return arm.whole.inverse_dynamics(run.q, run.dq, run.ddq, Pose(), (), GRAVITY).torque


def inside(run: OpenSimRun) -> FloatArray:
    return (run.time >= FIRST) & (run.time <= LAST)


def test_its_activations_are_those_of_opensims_tool(arm: Arm26, run: OpenSimRun) -> None:
    solver, found = StaticOptimization(6, 2), []
    for q, dq, tau in zip(run.q, run.dq, torque(arm, run), strict=True):
        arm.put(q, dq)
        solution = solver.solve(arm.arms(), arm.gain(), tau)
        assert not solution.shortfall.any()
        found.append(solution.activation)
    error = (np.array(found) - run.activation)[inside(run)]
    print(f"activation against OpenSim's: rms {np.sqrt((error**2).mean()):.5f}, largest {np.abs(error).max():.5f}")
    assert np.sqrt((error**2).mean(axis=0)).max() <= 0.02
    assert np.abs(error).max() <= 0.05
    assert run.activation[inside(run)].max() > 0.1


def test_its_contact_forces_are_opensims_joint_reactions(arm: Arm26, run: OpenSimRun) -> None:
    anatomy = arm.anatomy((-0.1, 0.0), (0.25, 1.7))
    contact = JointContact(arm.whole, anatomy, [f"right_{name}" for name in arm.names])
    needed = arm.whole.inverse_dynamics(run.q, run.dq, run.ddq, Pose(), (), GRAVITY)
    found = contact.over(run.q, Pose(), needed, run.force)
    for centre in JOINTS:
        expected = run.reactions[centre][inside(run)]
        error = np.linalg.norm(found[f"right_{centre}"][inside(run)] - expected, axis=1)
        size = np.linalg.norm(expected, axis=1)
        print(f"{centre}: {size.min():.0f} to {size.max():.0f} N, largest error {100 * (error / size).max():.2f} %")
        assert (error / size).max() <= 0.02
        assert (
            size.max()
            > 3.0 * np.linalg.norm(needed.force[:, arm.whole.index[contact.links[f"right_{centre}"]]], axis=1).max()
        )
