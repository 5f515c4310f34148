"""Payload of a plant's parameters: what the simulated robot carries from the start."""

from typing import Any

import numpy as np
import pinocchio
import pytest

from hric_core.errors import HricError

READY = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]
PAYLOAD = {
    "mass": 1.2,
    "com": [0.01, -0.02, 0.05],
    "inertia": [2e-3, 1e-4, 0.0, 3e-3, 0.0, 1.5e-3],
    "link": "panda_link8",
}


def test_a_payload_needs_its_weight_from_the_joints(make_plant: Any, panda_urdf: str) -> None:
    carrying = make_plant(panda_urdf, q=READY, payload=PAYLOAD, rotor_inertia=0.1)
    empty = make_plant(panda_urdf, q=READY, rotor_inertia=0.1)
    model = pinocchio.buildModelFromXML(panda_urdf)
    frame = model.getFrameId("panda_link8")
    weight = pinocchio.Force(9.81 * PAYLOAD["mass"] * np.array([0.0, 0.0, 1.0]), np.zeros(3))
    data = model.createData()
    q = np.array([*READY, *[0.0] * (model.nq - 7)])
    pinocchio.framesForwardKinematics(model, data, q)
    J = pinocchio.computeFrameJacobian(model, data, q, frame, pinocchio.LOCAL_WORLD_ALIGNED)[:, :7]
    arm = data.oMf[frame].rotation @ np.array(PAYLOAD["com"])
    expected = J.T @ np.concatenate([weight.linear, np.cross(arm, weight.linear)])
    torques = []
    for plant in (carrying, empty):
        plant.set_brakes([True] * 7)
        for _ in range(2000):
            plant.apply([0.0] * 7)
            plant.step()
        q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
        plant.read_state(q, dq, tau)
        torques.append(tau)
    np.testing.assert_allclose(np.subtract(*torques), expected, atol=1e-3)


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        ({"com": [0.0, 0.0, 0.1]}, r"plant/payload has no mass; valid: with plant/payload/mass above 0 \[kg\]"),
        ({"mass": -1.0}, r"plant/payload/mass is -1\.0; valid: "),
        ({"mass": 1.0, "link": "hook"}, "hook"),
    ],
)
def test_a_payload_that_cannot_be_is_refused(
    make_plant: Any, panda_urdf: str, payload: dict[str, Any], message: str
) -> None:
    with pytest.raises(HricError, match=message):
        make_plant(panda_urdf, payload=payload)
