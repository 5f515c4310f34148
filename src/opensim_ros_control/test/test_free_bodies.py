"""Free bodies in the world: laws of conservation, and continuation of the motion when the model is built again."""

import numpy as np
import pytest
from two_link import two_link_urdf

JOINTS = ["joint1", "joint2"]
STILL = [0.0, 0.0, 0.0]
MASS, MOMENTS = 2.0, np.array([0.02, 0.03, 0.04])
STICK = f"""<robot name="stick"><link name="body"><inertial><mass value="{MASS}"/>
  <inertia ixx="{MOMENTS[0]}" iyy="{MOMENTS[1]}" izz="{MOMENTS[2]}" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""  # noqa: E501


def run(plant, n):
    for _ in range(n):
        plant.apply([0.0, 0.0])
        plant.step()


def at(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def momentum(plant):
    """(angular momentum about the centre, kinetic energy) of the stick, world frame."""
    T, twist = plant.link_state("stick::body")
    inertia = T[:3, :3] @ np.diag(MOMENTS) @ T[:3, :3].T
    L = inertia @ twist[3:]
    return L, 0.5 * float(L @ twist[3:]) + 0.5 * MASS * float(twist[:3] @ twist[:3])


def test_a_tumbling_body_keeps_its_momentum_through_all_its_turns(make_plant):
    """It turns several times over all axes, so that its joint frame is laid again on the way."""
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    plant.reset([0.0, 0.0])
    plant.spawn("stick", STICK, at(3.0, 0.0, 1.0))
    plant.apply_wrench("stick::body", [20.0, 10.0, -5.0], [2.0, 30.0, 1.0], STILL, 0.010)
    run(plant, 10)
    L, energy = momentum(plant)
    frames = set()
    for _ in range(10):
        run(plant, 60)
        frames.add(plant.world.models["stick"].T_world_origin.tobytes())
        now, energy_now = momentum(plant)
        assert np.abs(now - L).max() < 1e-4 * np.abs(L).max()
        assert energy_now == pytest.approx(energy, rel=1e-4)
    assert len(frames) > 2


def test_models_and_robot_go_on_where_they_are_when_another_one_comes_or_goes(make_plant):
    """The same run with and without guests that touch nobody."""
    ends = []
    for guests in (False, True):
        plant = make_plant(two_link_urdf(), JOINTS)
        plant.reset([0.3, 0.2], [0.5, -1.0])
        plant.spawn("stick", STICK, at(3.0, 0.0, 1.0))
        plant.apply_wrench("stick::body", [2.0, 1.0, -0.5], [0.2, 0.3, 0.1], STILL, 0.010)
        for k in range(4):
            run(plant, 25)
            if guests:
                plant.delete("guest") if k % 2 else plant.spawn("guest", STICK, at(-3.0, 0.0, 1.0))
        q, dq = plant.engine_state()
        T, twist = plant.link_state("stick::body")
        ends.append(np.concatenate([q, dq, T.ravel(), twist, [plant.robot.time]]))
    assert np.abs(ends[1] - ends[0]).max() < 1e-9


def test_a_body_that_flies_falls_on_a_parabola(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS)
    plant.reset([0.0, 0.0])
    plant.spawn("stick", STICK, at(3.0, 0.0, 2.0))
    run(plant, 300)
    assert plant.link_state("stick::body")[0][2, 3] == pytest.approx(2.0 - 0.5 * 9.81 * 0.3**2, abs=1e-9)


def test_a_ball_on_a_spring_goes_the_way_it_goes_in_pybullet(make_plant, tmp_path):
    """Both semi-implicit: the same penalty contact, held over the same steps."""
    from pybullet_ros_control.plant import PyBulletPlant

    world = tmp_path / "world.yaml"
    world.write_text("""
objects:
  - {name: ball, shape: sphere, size: 0.05, mass: 5.0, pose: {xyz: [1.9491, 0.0, 1.0]}, velocity: {linear: [0.25, 0.0, 0.0]}, friction: 0.0}
  - {name: wall, shape: box, size: [1.0, 1.0, 1.0], pose: {xyz: [2.5, 0.0, 1.0]}, contact: penalty, stiffness: 75000.0, damping: 50.0}
""")  # noqa: E501
    config = {"world": str(world), "gravity": STILL, "integrator": "semi_implicit"}
    plants = [make_plant(two_link_urdf(), JOINTS, **config), PyBulletPlant(two_link_urdf(), JOINTS, config)]
    ways = []
    for plant in plants:
        plant.reset([0.0, 0.0])
        way = []
        for _ in range(60):
            run(plant, 1)
            way.append([plant.link_state("ball::link")[0][0, 3], sum(contact.force for contact in plant.contacts())])
        ways.append(np.array(way))
    plants[1].close()
    assert ways[0][:, 1].max() > 100.0
    assert np.abs(ways[0][:, 0] - ways[1][:, 0]).max() < 1e-9
    assert ways[0][:, 1] == pytest.approx(ways[1][:, 1], abs=1e-4)
