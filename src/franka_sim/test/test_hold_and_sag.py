import hashlib
import struct
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

import panda_description
from franka_msgs.srv import SetLoadRequest
from hric_control.hardware_interface import EffortJointInterface
from hric_control.plant import Load

PAYLOAD = Load(1.0, (0.02, -0.03, 0.1), (0.002, 0, 0, 0, 0.003, 0, 0, 0, 0.001))
CASES = {
    "bare": {"hand": False},
    "with hand": {},
    "tilted with hand": {"rpy": "0.5 -0.8 0.3"},
    "without rotor inertia": {"plant": {"rotor_inertia": 0.0}},
}


def drift(arm, claim, duration: float) -> float:
    arm.hw.do_switch([claim()], [])
    start, worst = arm.hw.states.position[:], [0.0]

    def law(time: float) -> None:
        worst[0] = max(worst[0], *(abs(a - b) for a, b in zip(arm.hw.states.position, start, strict=True)))

    arm.run(duration, law)
    return worst[0]


def tell(arm, load: Load) -> None:
    request = SetLoadRequest(mass=load.mass, F_x_center_load=load.com, load_inertia=load.inertia)
    response = arm.node.call("franka_control/set_load", request)
    assert response.success, response.error


@pytest.mark.parametrize("case", CASES)
def test_zero_command_holds(make_arm, claim, case) -> None:
    assert drift(make_arm(**CASES[case]), claim, 3.0) < 1e-6


def test_zero_command_holds_for_60_s_with_a_payload_that_was_set(make_arm, claim) -> None:
    arm = make_arm()
    arm.hw.plant.set_load(PAYLOAD, "panda_link8")
    tell(arm, PAYLOAD)
    assert drift(arm, claim, 60.0) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_zero_command_holds_for_60_s(make_arm, claim, case) -> None:
    assert drift(make_arm(**CASES[case]), claim, 60.0) < 1e-6


def equilibrium(q_d: np.ndarray, kp: float, load: Load) -> np.ndarray:
    """Where Kp (q_d - q) + g(q) of the arm equals g(q) of the arm with the payload, by Newton's method."""
    urdf = panda_description.load(meshes=False, collision=False)
    light, heavy = pin.buildModelFromXML(urdf), pin.buildModelFromXML(urdf)
    flange = heavy.frames[heavy.getFrameId("panda_link8")].placement
    heavy.appendBodyToJoint(7, pin.Inertia(load.mass, np.array(load.com), np.array(load.inertia).reshape(3, 3)), flange)
    models = [(model, model.createData()) for model in (light, heavy)]

    def missing(q: np.ndarray) -> np.ndarray:
        told, true = (pin.computeGeneralizedGravity(model, data, q).copy() for model, data in models)
        return kp * (q_d - q) + told - true

    q = q_d.copy()
    for _ in range(20):
        told, true = (pin.computeGeneralizedGravityDerivatives(model, data, q).copy() for model, data in models)
        q = q - np.linalg.solve(-kp * np.eye(7) + told - true, missing(q))
    assert np.abs(missing(q)).max() < 1e-10
    return q


def test_with_a_payload_that_was_not_set_a_pd_law_sags_to_the_analytic_equilibrium(make_arm, claim) -> None:
    arm, kp, kd = make_arm(parameters={"settings_while_moving": True}), 200.0, 60.0
    hw = arm.hw
    hw.plant.set_load(PAYLOAD, "panda_link8")
    hw.do_switch([claim()], [])
    q_d, joints = hw.q_start, hw.get(EffortJointInterface).group()

    def law(time: float) -> None:
        joints.set_command(
            [kp * (a - q) - kd * dq for a, q, dq in zip(q_d, hw.states.position, hw.states.velocity, strict=True)]
        )

    arm.run(8.0, law)
    expected = equilibrium(np.array(q_d), kp, PAYLOAD)
    assert np.abs(np.array(q_d) - expected).max() > 0.01
    assert np.abs(np.array(hw.states.position) - expected).max() < 1e-6
    tell(arm, PAYLOAD)
    arm.run(8.0, law)
    assert np.abs(np.array(hw.states.position) - q_d).max() < 1e-6


RUN = """
import hashlib, struct, sys
sys.path.insert(0, sys.argv[1])
from conftest import Arm, claim
arm = Arm({}, {}, {})
from hric_control.hardware_interface import EffortJointInterface
joints = arm.hw.get(EffortJointInterface).group()
digest = hashlib.sha256()
arm.hw.do_switch([claim()], [])
def law(time):
    digest.update(struct.pack("14d", *arm.hw.states.position, *arm.hw.states.velocity))
    joints.set_command([0.3, -0.2, 0.1, 0.2, -0.1, 0.05, 0.02])
arm.run(0.5, law)
arm.hw.do_switch([], [claim()])
arm.run(0.5, law)
print(digest.hexdigest())
"""


def test_two_processes_give_the_same_bits() -> None:
    from pathlib import Path

    command = [sys.executable, "-c", RUN, str(Path(__file__).parent)]
    first, second = (
        subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout.split()[-1]
        for _ in range(2)
    )
    assert len(first) == 64
    assert first == second


def test_a_run_after_reset_gives_the_same_bits(make_arm, claim) -> None:
    arm, digests = make_arm(), []
    arm.hw.do_switch([claim()], [])
    joints = arm.hw.get(EffortJointInterface).group()
    for _ in range(2):
        digest = hashlib.sha256()

        def law(time: float, digest=digest) -> None:
            digest.update(struct.pack("14d", *arm.hw.states.position, *arm.hw.states.velocity))
            joints.set_command([0.5] * 7)

        arm.run(0.3, law)
        digests.append(digest.hexdigest())
        arm.hw.reset()
    assert digests[0] == digests[1]
