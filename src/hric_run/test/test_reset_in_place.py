"""Parts of a run with actions between them: `advance`, `command`, `observe`, and a reset in place with equal bits."""

import hashlib

import numpy as np
import pytest

from hric_core.errors import HricError
from hric_core.geometry import Pose
from hric_run.observation import SimulationState
from hric_run.simulation import Simulation

Q = [0.1, -0.7, 0.05, -2.3, 0.0, 1.5, 0.7]
"""Start position other than the default [rad]."""
VARIED = {"human.control.parameters.reference.variation": {"position": 0.01}}


def bits(observation: SimulationState) -> bytes:
    arm, person = observation.arm, observation.person
    values = [arm.q, arm.dq, arm.tau, arm.T_base_ee, arm.wrench_base, np.array([observation.time])]
    if person is not None:
        values += [person.q, person.dq, person.T_world_root, person.T_world_hand, person.tau, person.strength_share]
        values += [] if person.activations is None else [person.activations]
    contacts = [(contact.body_a, contact.body_b, contact.force) for contact in observation.contacts]
    text = f"{observation.separation} {contacts}"
    return b"".join(np.ascontiguousarray(value).tobytes() for value in values if value is not None) + text.encode()


def digest(simulation: Simulation, steps: int = 20) -> tuple[str, str]:
    """Return hashes of all observations of some steps of 40 ms, and of the control log."""
    simulation.observe()
    digest = hashlib.sha256()
    for _ in range(steps):
        simulation.advance(40)
        digest.update(bits(simulation.observe()))
    return digest.hexdigest(), simulation.state_sha256


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("pd_step", {"realism": "measured"}),
        ("pd_step", {"simulator": "pybullet"}),
        ("hand_guidance", VARIED),
        ("contact", {"human.drive": "muscle"}),
        ("handover", {}),
        ("co_transport", {}),
    ],
)
def test_a_run_after_a_reset_in_place_has_the_bits_of_a_new_simulation(name: str, overrides: dict[str, object]) -> None:
    chosen = {"simulator": "mujoco", **overrides}
    wanted = {}
    for seed in (1, 2):
        with Simulation(name, seed=seed, **chosen) as simulation:
            wanted[seed] = digest(simulation)
    with Simulation(name, seed=2, **chosen, **{"robot.q_start": Q}) as simulation:
        wanted[0] = digest(simulation)
    with Simulation(name, seed=1, **chosen) as simulation:
        simulation.run(0.3)
        for seed, q in ((2, None), (1, None), (1, None), (0, Q)):
            simulation.reset(in_place=True, seed=seed or 2, q_start=q)
            assert simulation.time == 0.0 and digest(simulation) == wanted[seed], (seed, q)
    if overrides in (VARIED, {"realism": "measured"}):
        assert wanted[1] != wanted[2]


def test_a_reset_in_place_clears_a_reflex_and_restarts_all_controllers() -> None:
    with Simulation("contact", simulator="mujoco") as simulation:
        before = digest(simulation)
        simulation.run(2.0)
        assert "cartesian_reflex" in simulation.app.hw.robot_state.last_motion_errors
        simulation.reset(in_place=True)
        assert digest(simulation) == before
        assert [item.state for item in simulation.app.manager.list()] == ["running"] * 3


def test_what_cannot_be_reset_in_place_is_refused() -> None:
    refusal = pytest.raises(HricError, match="motion capture, sensors or a supervisor, which have no reset in place")
    with Simulation("marker_tracking", duration=0.1) as simulation, refusal:
        simulation.reset(in_place=True)
    with Simulation("pd_step", duration=0.1) as simulation:
        with pytest.raises(HricError, match="kp cannot be changed by a reset in place; valid: seed, q_start"):
            simulation.reset(in_place=True, kp=100)
        with pytest.raises(HricError, match="q_start"):
            simulation.reset(in_place=True, q_start=[9.0] * 7)
        with pytest.raises(HricError, match="at least 1"):
            simulation.advance(0)


def test_parts_of_a_run_have_the_bits_of_a_run() -> None:
    with Simulation("pd_step", duration=0.3) as simulation:
        simulation.run()
        whole = simulation.state_sha256
        simulation.reset()
        for cycles in (1, 99, 200):
            simulation.advance(cycles)
        assert simulation.state_sha256 == whole and simulation.signals.cycles == 300


def test_a_command_moves_the_arm_as_a_message_does() -> None:
    overrides = {"parameters.joint_pd_controller.profile.enabled": False, "setpoints": []}
    with Simulation("pd_step", simulator="mujoco", **overrides) as simulation:
        simulation.advance(10)
        start = simulation.observe().arm.q
        change = np.array([0.1, 0.0, 0.0, -0.1, 0.0, 0.0, 0.1])
        simulation.command("joint_pd_controller", start + change)
        simulation.advance(1000)
        np.testing.assert_allclose(simulation.observe().arm.q, start + change, atol=0.02)
        with pytest.raises(HricError, match="panda_joint4 1 is outside"):
            simulation.command("joint_pd_controller", [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        with pytest.raises(HricError, match="nothing subscribes to joint_pd_controller/equilibrium_pose"):
            simulation.command("joint_pd_controller", Pose())
    with Simulation("hand_guidance", simulator="mujoco") as simulation:
        simulation.advance(10)
        T = simulation.observe().arm.T_base_ee
        assert T is not None
        x, y, z = T[:3, 3].tolist()
        simulation.command("cartesian_impedance_controller", Pose((x, y + 0.1, z), (1.0, 0.0, 0.0, 0.0)))
        simulation.advance(500)
        moved = simulation.observe().arm.T_base_ee
        assert moved is not None and moved[1, 3] - y > 0.01


def test_the_observation_is_the_state_that_the_messages_report() -> None:
    heard: dict[str, object] = {}
    with Simulation("contact", simulator="mujoco", **{"robot.parameters.reflexes": False}) as simulation:
        simulation.node.tap(lambda topic, message, _: heard.__setitem__(topic, message))
        simulation.observe()
        simulation.advance(1)
        while not (observation := simulation.observe()).contacts and observation.time < 3.0:
            simulation.advance(5)
    person = observation.person
    assert person is not None and observation.separation is not None
    assert {contact.kind for contact in observation.contacts} == {"penalty"} and observation.separation < 0.0
    joints, torque = heard["/hric/human/joint_states"], heard["/hric/human/joint_torque"]
    assert tuple(joints.name) == person.joints  # type: ignore[attr-defined]
    # The message is from the state before the last step of 1 ms.
    np.testing.assert_allclose(person.q, joints.position, atol=2e-3 * np.abs(person.dq).max() + 1e-9)  # type: ignore[attr-defined]
    np.testing.assert_array_equal(person.tau, torque.torque)  # type: ignore[attr-defined]
