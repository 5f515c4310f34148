"""What a user of panda-python writes: `python panda_py_user.py IP NAME` runs one of the functions below and prints what
it found as JSON."""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import panda_py
from panda_py import constants, controllers, libfranka

import panda_description

START = constants.JOINT_POSITION_START
LIMIT = 20.0
"""[s of wall time]"""


def wait(controller: Any, seconds: float) -> None:
    """Wait until the robot's time, as panda-python's controller counts it, has advanced [s]."""
    end, limit = controller.get_time() + seconds, time.monotonic() + LIMIT
    while controller.get_time() < end and time.monotonic() < limit:
        time.sleep(1e-3)


def raised(panda: Any) -> str:
    """Return the text with which panda-python's raise_error ends the running controller."""
    limit = time.monotonic() + LIMIT
    while time.monotonic() < limit:
        try:
            panda.raise_error()
        except RuntimeError as error:
            return str(error)
        time.sleep(1e-3)
    return "nothing"


def farthest(panda: Any, q: Any = START) -> float:
    """Largest distance of a joint from q [rad]."""
    return float(np.abs(panda.q - q).max())


def from_goal(panda: Any, goal: Any) -> tuple[float, float]:
    """Distance of the end effector from a pose [m], [rad]."""
    pose = panda.get_pose()
    cosine = 0.5 * (np.trace(pose[:3, :3].T @ goal[:3, :3]) - 1.0)
    return float(np.linalg.norm((pose - goal)[:3, 3])), float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def moved(pose: Any, y: float, z: float) -> Any:
    """Return the pose, moved by a translation [m]."""
    goal = pose.copy()
    goal[1:3, 3] += y, z
    return goal


def joint_motions(panda: Any) -> dict[str, Any]:
    """Move to the start, to one position, and along several positions."""
    there = START + 0.2
    waypoints = [START + 0.1, START - 0.1, START + np.array([0.3, 0, 0, 0, 0, 0, -0.3])]
    found = {"there": [panda.move_to_joint_position(there), farthest(panda, there)]}
    found["waypoints"] = [panda.move_to_joint_position(waypoints), farthest(panda, waypoints[-1])]
    found["start"] = [panda.move_to_start(), farthest(panda)]
    return found


def held(panda: Any, goal: Any, orientation: Any, nullspace_stiffness: float = 15.0) -> tuple[float, float]:
    """Hold the goal of move_to_pose for a second more with its own gains; return the distance then [m], [rad]."""
    law = controllers.CartesianImpedance(np.diag([800.0] * 3 + [40.0] * 3), 1.0, nullspace_stiffness)
    panda.start_controller(law)
    law.set_control(goal[:3, 3], orientation, START)
    wait(law, 1.0)
    panda.stop_controller()
    return from_goal(panda, goal)


def pose_motions(panda: Any) -> dict[str, Any]:
    """A diagonal of 14 cm with panda-python's own gains, without what it does in the null space, and with two poses to
    pass."""
    found: dict[str, Any] = {}
    for name, arguments in (
        ("usual", {}),
        ("soft null space", {"nullspace_stiffness": 1.5}),
        ("no null space", {"nullspace_stiffness": 0.0}),
    ):
        panda.move_to_start()
        goal, orientation = moved(panda.get_pose(), 0.1, -0.1), panda.get_orientation()
        found[name] = [panda.move_to_pose(goal, **arguments), *held(panda, goal, orientation, **arguments)]
    panda.move_to_start()
    poses = [moved(panda.get_pose(), 0.0, -0.1), moved(panda.get_pose(), 0.1, -0.1)]
    orientation, success = panda.get_orientation(), panda.move_to_pose(poses, nullspace_stiffness=0.0)
    found["waypoints"] = [success, *held(panda, poses[-1], orientation, 0.0)]
    return found


def resting_pose(panda: Any) -> dict[str, Any]:
    """Where the impedance controller with the gains of move_to_pose rests: joints, the goal, the null space's goal, and
    the Jacobian there."""
    goal, law = (
        moved(panda.get_pose(), 0.05, -0.05),
        controllers.CartesianImpedance(np.diag([800.0] * 3 + [40.0] * 3), 1.0, 15.0),
    )
    orientation, start = panda.get_orientation(), panda.get_pose()
    panda.start_controller(law)
    for share in np.linspace(0.0, 1.0, 101):
        law.set_control((start + share * (goal - start))[:3, 3], orientation, START)
        wait(law, 0.02)
    wait(law, 8.0)
    state = panda.get_state()
    jacobian = panda.get_model().zero_jacobian(libfranka.Frame.kEndEffector, state)
    found = {
        "q": list(state.q),
        "dq": list(state.dq),
        "pose": panda.get_pose().tolist(),
        "goal": goal.tolist(),
        "jacobian": list(jacobian),
    }
    panda.stop_controller()
    return found | {"q_null": list(START)}


def joint_controllers(panda: Any) -> dict[str, Any]:
    """Use JointPosition along a ramp, and IntegratedVelocity for a second."""
    law, goal = controllers.JointPosition(), START + 0.1
    panda.start_controller(law)
    for share in np.linspace(0.0, 1.0, 101):
        law.set_control(START + share * (goal - START))
        wait(law, 0.01)
    wait(law, 1.5)
    panda.stop_controller()
    found = {"position": farthest(panda, goal), "moving": panda.is_moving()}
    panda.move_to_start()
    velocity = controllers.IntegratedVelocity()
    panda.start_controller(velocity)
    velocity.set_control([0.0, 0.0, 0.0, 0.2, 0.0, 0.0, -0.2])
    wait(velocity, 1.0)
    velocity.set_control([0.0] * 7)
    wait(velocity, 1.5)
    goal = velocity.get_qd()
    panda.stop_controller()
    panda.raise_error()
    return found | {"integral": (goal - START).tolist(), "velocity": farthest(panda, goal)}


def task_controllers(panda: Any) -> dict[str, Any]:
    """Use CartesianImpedance to a pose near by, and AppliedForce downwards."""
    law, goal = controllers.CartesianImpedance(), moved(panda.get_pose(), 0.05, -0.05)
    orientation = panda.get_orientation()
    panda.start_controller(law)
    law.set_control(goal[:3, 3], orientation, panda.q)
    wait(law, 3.0)
    panda.stop_controller()
    found = {"impedance": from_goal(panda, goal)}
    panda.move_to_start()
    before, force = panda.get_position(), controllers.AppliedForce(damping=[5.0] * 7)
    panda.start_controller(force)
    force.set_control([0.0, 0.0, -3.0, 0.0, 0.0, 0.0])
    wait(force, 1.0)
    force.set_control([0.0] * 6)
    wait(force, 0.5)
    panda.stop_controller()
    panda.raise_error()
    return found | {"force": (panda.get_position() - before).tolist()}


def torque_and_log(panda: Any) -> dict[str, Any]:
    """A torque at joint 7: its acceleration by the log, and by the model's mass matrix with the rotors."""
    law, tau = controllers.AppliedTorque(), [0.0] * 6 + [0.2]
    mass = np.array(panda.get_model().mass(panda.get_state())).reshape(7, 7)
    inertia = mass + np.diag(panda_description.rotor_inertia())
    panda.start_controller(law)
    panda.enable_logging(3000)
    law.set_control(tau)
    wait(law, 0.5)
    log = panda.get_log()
    panda.disable_logging()
    panda.stop_controller()
    panda.raise_error()
    dq = np.array(log["dq"])[-200:, 6]
    return {
        "steps": sorted(set(np.diff(np.array(log["time"]).ravel()).tolist())),
        "fields": sorted(log),
        "measured": float((dq[-1] - dq[0]) / ((len(dq) - 1) * 1e-3)),
        "expected": float(np.linalg.solve(inertia, tau)[6]),
    }


def context(panda: Any) -> dict[str, Any]:
    """Run a loop of the user's own code at the pace of the robot's time."""
    law = controllers.JointPosition()
    panda.start_controller(law)
    goal = START
    with panda.create_context(frequency=1000, max_runtime=1.0) as loop:
        while loop.ok():
            goal = START + 0.1 * np.sin(0.5 * np.pi * min(loop.time, 1.0)) ** 2
            law.set_control(goal)
        ticks = loop.num_ticks
    wait(law, 1.5)
    panda.stop_controller()
    panda.raise_error()
    return {"ticks": ticks, "distance": farthest(panda, goal), "way": float((goal - START)[0])}


def errors(panda: Any) -> dict[str, Any]:
    """Too fast: named by raise_error, then recovered from. A controller that gives up by itself. What the arm does
    after both."""
    found: dict[str, Any] = {}
    for name, law, target in (
        ("fast", controllers.AppliedTorque(), [0.0] * 6 + [3.0]),
        ("threshold", controllers.Force(), [0.0, 0.0, -5.0]),
    ):
        panda.start_controller(law)
        law.set_control(target)
        found[name] = raised(panda)
        found[name + " mode"] = str(panda.get_robot().read_once().robot_mode)
        panda.recover()
        panda.raise_error()
        found[name + " recovered"] = str(panda.get_robot().read_once().robot_mode)
        found[name + " after"] = [panda.move_to_start(), farthest(panda)]
    return found


def the_rest(panda: Any) -> dict[str, Any]:
    """Call the remaining functions: teaching, default behaviour, model, robot, hand."""
    panda.set_default_behavior()
    panda.teaching_mode(True)
    time.sleep(0.2)
    found: dict[str, Any] = {"teaching": panda.is_moving()}
    panda.teaching_mode(False)
    panda.move_to_start()
    time.sleep(0.5)  # the arm comes to rest
    model, state = panda.get_model(), panda.get_robot().read_once()
    found["pose"] = float(np.abs(np.array(model.pose(libfranka.Frame.kEndEffector, state)) - state.O_T_EE).max())
    found["gravity"] = float(np.abs(np.array(model.gravity(state)) - state.tau_J).max())
    hand = libfranka.Gripper(sys.argv[1])
    found["hand"] = [
        hand.homing(),
        hand.move(0.04, 0.1),
        hand.read_once().width,
        hand.grasp(0.02, 0.1, 10.0, 0.005, 0.005),
        hand.stop(),
    ]
    return found


PROGRAMS: dict[str, Callable[[Any], dict[str, Any]]] = {
    program.__name__: program
    for program in (
        joint_motions,
        pose_motions,
        resting_pose,
        joint_controllers,
        task_controllers,
        torque_and_log,
        context,
        errors,
        the_rest,
    )
}

if __name__ == "__main__":
    arm = panda_py.Panda(sys.argv[1])
    arm.recover()
    arm.move_to_start()
    print(json.dumps(PROGRAMS[sys.argv[2]](arm)))
