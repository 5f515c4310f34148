"""Joint torques reported by a plant: those of torque sensors on the output side of the gears."""

import numpy as np
import pinocchio
import pytest
from rigid_body_oracle import Oracle

import panda_description


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_the_torque_that_is_read_is_that_behind_the_rotors(make_plant, panda_urdf, rotor):
    """Check that the read torque is that of inverse dynamics without rotors, plus joint friction."""
    friction = panda_description.friction_parameters()
    plant = make_plant(
        panda_urdf, rotor_inertia=rotor, friction="identified", friction_parameters=friction, self_collision=False
    )
    oracle = Oracle(panda_urdf)
    start, phase = np.array([0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]), np.arange(7.0)
    plant.reset(start)
    phi1, phi2, phi3 = (np.array([friction[f"panda_joint{i}"][f"phi{k}"] for i in range(1, 8)]) for k in (1, 2, 3))
    q, dq, tau, rows = [0.0] * 7, [0.0] * 7, [0.0] * 7, []
    for step in range(4000):
        plant.read_state(q, dq, tau)
        rows.append((q[:], dq[:], tau[:]))
        at, target = np.array(q), start + 0.3 * (1 - np.cos(2 * np.pi * 0.4 * 1e-3 * step)) * np.cos(phase)
        applied = 50.0 * (target - at) - 5.0 * np.array(dq) + oracle.gravity(at)
        plant.apply(applied)
        plant.step()
    Q, V, T = (np.array(column) for column in zip(*rows, strict=True))
    acceleration = np.diff(V, axis=0) * 1e3
    middle_q, middle_v = (0.5 * (x[1:] + x[:-1]) for x in (Q, V))
    wanted = [
        pinocchio.rnea(oracle.model, oracle.data, a, b, c)
        for a, b, c in zip(middle_q, middle_v, acceleration, strict=True)
    ]
    wanted += phi1 / (1 + np.exp(-phi2 * (middle_v + phi3))) - phi1 / (1 + np.exp(-phi2 * phi3))
    error = np.sqrt(np.mean((T[1:] - wanted) ** 2, axis=0))
    print(
        f"rotor inertia {rotor}: RMS {error.max():.1e} N m, accelerations to {np.abs(acceleration).max():.1f} rad/s^2"
    )
    assert np.abs(acceleration).max() > 1.5
    assert error.max() < 0.02
    assert plant.motor_effort() == applied.tolist()
