"""The whole stack on the generic robot: manager, JointPDController with its gravity term, PyBullet; against the second
library."""

import numpy as np
import pytest
from rigid_body_oracle import Oracle
from std_msgs.msg import Float64MultiArray

import panda_description
from hric_control.robot_app import RobotApp
from hric_control.sim.robot_hw_sim import RobotHWSim
from hric_core.local.node import LocalNode

PANDA = [f"panda_joint{i}" for i in range(1, 8)]
GOAL = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]


@pytest.fixture
def make_app():
    apps = []

    def make(urdf, q_start, kp, kd, **plant):
        law = {"type": "hric_controllers/JointPDController", "joints": PANDA, "kp": kp, "kd": kd, "gravity": True}
        law |= {"profile": {"enabled": False}, "rotatum_limit": 0.0}
        robot = {
            "real_time_factor": 0.0,
            "enforce_limits": False,
            "q_start": list(q_start),
            "plant": {"self_collision": False, **plant},
        }
        node = LocalNode({"robot_description": urdf, "law": law})
        apps.append(RobotApp(node, LocalNode(robot), hw=RobotHWSim()))
        apps[-1].manager.load("law")
        apps[-1].manager.switch(["law"], [], loop_running=False)
        return apps[-1], node

    yield make
    for app in apps:
        app.shutdown()


def raw_step(app, node, duration):
    """Positions as the controller reads them from the cycle in which it gets the setpoint, shape (steps, 7)."""
    command = node.advertise("law/command", Float64MultiArray)
    positions = []

    def on_cycle(time):
        if app.cycles == 1:
            command.publish(Float64MultiArray(data=GOAL))
        if app.cycles >= 1:
            positions.append(app.hw.states.position[:])

    app.run(duration, on_cycle)
    return np.array(positions)


@pytest.mark.parametrize(
    ("rotor", "kp", "kd", "tolerance"), [(0.0, 50.0, 5.0, 1e-4), (0.1, 50.0, 10.0, 2e-5), (0.1, 200.0, 100.0, 2e-5)]
)
def test_the_raw_step_of_the_thesis_stays_near_a_fourth_order_integration(
    make_app, wide_panda_urdf, rotor, kp, kd, tolerance
):
    app, node = make_app(wide_panda_urdf, [0.0] * 7, kp, kd, rotor_inertia=rotor)
    positions = raw_step(app, node, 4.0)
    expected = Oracle(wide_panda_urdf, rotor).pd_run(np.array(GOAL), kp, kd, 4.0, np.zeros(7))[: len(positions)]
    error = np.abs(positions - expected).max()
    print(f"rotor inertia {rotor}, Kp {kp}, Kd {kd}: {error:.3g} rad")
    assert len(positions) >= 3998
    assert error < tolerance


@pytest.mark.parametrize(
    ("hand", "rotor"),
    [
        (True, 0.1),
        *(
            pytest.param(hand, rotor, marks=pytest.mark.slow)
            for hand, rotor in [(False, 0.0), (False, 0.1), (True, 0.0)]
        ),
    ],
)
def test_zero_gains_with_the_gravity_term_hold_for_60_s(make_app, hand, rotor):
    app, _ = make_app(panda_description.load(hand=hand, meshes=False), GOAL, 0.0, 0.0, rotor_inertia=rotor)
    app.run(60.0)
    drift = max(abs(q - goal) for q, goal in zip(app.hw.states.position, GOAL, strict=True))
    print(f"hand {hand}, rotor inertia {rotor}: {drift:.3g} rad")
    assert drift < 1e-6
