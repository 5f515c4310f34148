"""Accelerometers of the FR3: specific force at the frames of the maker's description, against pinocchio."""

import json
import struct

import numpy as np
import pinocchio
import pytest
from fci_peer import Peer, control_box, run_client

from franka_sim.fci.app import ControlBoxCommand
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.protocol import PROTOCOL_5, PROTOCOL_10
from franka_sim.fci.robots import ROBOTS, fr3_accelerometers, fr3_served_urdf
from franka_sim.fci.world_building import make_arm

TOP, BOTTOM = 1144, 1216
"""Offsets of the two blocks in the state datagram (libfranka-common, d96c221)."""
GRAVITY = np.array([0.0, 0.0, -9.81])


def readings(datagram: bytes) -> np.ndarray:
    """Return the specific forces, shape (12, 3) [m/s^2]: six at the top, six at the bottom."""
    return np.array([struct.unpack_from("<18f", datagram, at) for at in (TOP, BOTTOM)]).reshape(12, 3)


@pytest.fixture
def arm() -> ArmDevice:
    options = ControlBoxCommand().parser().parse_args(["--robot", "fr3", "--no-collision"])
    return make_arm(options, ROBOTS["fr3"])


def test_they_measure_acceleration_less_gravity_at_the_frames_of_the_served_description(arm: ArmDevice) -> None:
    model = pinocchio.buildModelFromXML(fr3_served_urdf())
    data, random = model.createData(), np.random.default_rng(1)
    for _ in range(50):
        q, dq, ddq = random.uniform(-2.0, 2.0, 7), random.uniform(-2.0, 2.0, 7), random.uniform(-10.0, 10.0, 7)
        state = arm.state
        state.q[:], state.dq[:], state.dq_before[:] = q, dq, dq - 1e-3 * ddq
        measured = readings(arm.encode(PROTOCOL_10.state, 1))
        pinocchio.forwardKinematics(model, data, q, dq, ddq)
        for name, force in zip(fr3_accelerometers(), measured, strict=True):
            frame = model.getFrameId(name)
            acceleration = pinocchio.getFrameClassicalAcceleration(model, data, frame, pinocchio.LOCAL).linear
            R = pinocchio.updateFramePlacement(model, data, frame).rotation
            assert force == pytest.approx(acceleration - R.T @ GRAVITY, abs=1e-4), name


def test_at_rest_they_measure_the_weight_upwards() -> None:
    with control_box("--robot", "fr3", "--no-collision") as (ip, _), Peer(ip, 10) as peer:
        for _ in range(10):
            state = peer.state()
    forces = readings(state)
    assert np.linalg.norm(forces, axis=1) == pytest.approx([9.81] * 12, abs=1e-4)
    assert forces[0] == pytest.approx([0.0, 0.0, -9.81], abs=1e-4), "the one at the top of the base looks down"
    assert forces[6] == pytest.approx([0.0, 0.0, 9.81], abs=1e-4)


def test_the_panda_has_none_and_its_state_is_as_before() -> None:
    assert ROBOTS["panda"].accelerometers() == {}
    assert PROTOCOL_5.state.accelerometers == () and PROTOCOL_5.state.size == 2373


FRANKA_RS = """
import json, sys
import franka
state = franka.Robot(sys.argv[1], realtime="ignore").read_once()
print(json.dumps([state.accelerometer_top.tolist(), state.accelerometer_bottom.tolist()]))
"""


def test_franka_rs_reads_them() -> None:
    pytest.importorskip("franka")
    with control_box("--robot", "fr3", "--no-collision") as (ip, _):
        top, bottom = json.loads(run_client(FRANKA_RS, ip))
    assert np.linalg.norm([*top, *bottom], axis=1) == pytest.approx([9.81] * 12, abs=1e-3)
    assert top[0] == pytest.approx([0.0, 0.0, -9.81], abs=1e-3)
