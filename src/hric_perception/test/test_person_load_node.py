"""The node `person` with a measured force on a hand: what their muscles do, how late, and what is flagged."""

import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio
import pytest
from before_cameras import BODY, SETTINGS, Swings, begin, listen, processor_time
from geometry_msgs.msg import WrenchStamped
from real_master import ros, roscore
from sensor_nodes import Diagnosis, Nodes, TellsTime, nodes, run, wait

from franka_msgs.msg import FrankaState
from hric_core.geometry import Pose, transformed
from hric_core.robot_time import stamps
from hric_human.control.kinematics import HandChain
from hric_human.muscles import BUILT_IN, load
from hric_motion.live_load import FEWEST, GAP, WINDOW
from hric_msgs.msg import JointReactions, JointTorque, MuscleActivation, PersonLoad, PersonTracking

__all__ = ["nodes", "ros", "roscore", "run"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
Figure = Callable[[str, float, str], None]
ANATOMY = load(BUILT_IN)
IN_RANGE = {
    f"{side}_{joint}": (low + 0.1, high - 0.1)
    for side in ("right", "left")
    for joint, low, high in zip(ANATOMY.joints, ANATOMY.lower, ANATOMY.upper, strict=True)
}
ROOT, HAND = SETTINGS.root(BODY), HandChain(BODY, "right")
JOINTS = list(BODY.joints)
BASE = Pose((0.2, -0.3, 0.1), (0.0, 0.0, 0.6, 0.8))
"""Pose of the robot's base in the frame of the markers."""
STATE_RATE, PLATE_RATE = 30.0, 100.0
LATEST = 1.0
"""Largest permitted delay of the load [s of robot time]."""


@pytest.fixture
def swings(run: TellsTime) -> Iterator[Swings]:
    made = Swings(run, IN_RANGE)
    yield made
    made.close()


class Publishes:
    """Messages of robot time.

    Args:
        run: by whose time.
        topic, kind: of them.
        rate: [Hz].
        make: message for a time.
    """

    def __init__(self, run: TellsTime, topic: str, kind: type, rate: float, make: Callable[[float], Any]) -> None:
        import rospy

        self._run, self._rate, self._make, self._stop = run, rate, make, threading.Event()
        self._publisher = rospy.Publisher(topic, kind, queue_size=100)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        due = round(self._run.time * self._rate)
        while not self._stop.wait(0.5 / self._rate):
            while due / self._rate <= self._run.time:
                message = self._make(due / self._rate)
                message.header.stamp = stamps.to_time(due / self._rate)
                self._publisher.publish(message)
                due += 1

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._publisher.unregister()


def palm(swings: Swings, time: float) -> np.ndarray:
    return np.array(transformed(ROOT, HAND.pose(swings.joints(time)[0].tolist()).position))


def exerted(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return force [N] and torque [N m] that the robot exerts, in its base."""
    s, c = np.sin(2.0 * time), np.cos(2.0 * time)
    return np.array([10.0 * s, 8.0 * c, -15.0]), np.array([0.5 * c, 0.0, 0.5 * s])


def robot_state(swings: Swings, time: float) -> Any:
    """Return a robot state in which the arm holds the person's palm, with K rotated and off the end effector."""
    R = pinocchio.Quaternion(*np.roll(BASE.orientation, 1)).matrix()
    O_p_K = R.T @ (palm(swings, time) - BASE.position)
    turn = pinocchio.exp3(np.array([0.3, -0.4, 0.5]))
    EE_p_K = np.array([0.0, 0.02, 0.1])
    message = FrankaState(O_F_ext_hat_K=np.concatenate(exerted(time)).tolist())
    message.O_T_EE = pinocchio.SE3(turn, O_p_K - turn @ EE_p_K).homogeneous.T.ravel().tolist()
    message.EE_T_K = pinocchio.SE3(turn, EE_p_K).homogeneous.T.ravel().tolist()
    return message


def needed(swings: Swings, time: float) -> np.ndarray:
    """Return the joint torque by pinocchio [N m], with the robot's force on the hand and the person's root at rest."""
    model = pinocchio.buildModelFromXML(BODY.urdf, pinocchio.JointModelFreeFlyer())
    data, joints = model.createData(), [model.joints[model.getJointId(name)] for name in JOINTS]
    q, v, a = np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.nv)
    q[:3], q[3:7] = ROOT.position, ROOT.orientation
    columns = [joint.idx_v for joint in joints]
    q[[joint.idx_q for joint in joints]], v[columns] = swings.joints(time)
    a[columns] = swings.accelerations(time)
    pinocchio.forwardKinematics(model, data, q)
    R = pinocchio.Quaternion(*np.roll(BASE.orientation, 1)).matrix()
    force, torque = (R @ one for one in exerted(time))
    acting = pinocchio.StdVec_Force([pinocchio.Force.Zero() for _ in range(model.njoints)])
    hand = model.frames[model.getFrameId("r_wrist")].parentJoint
    moment = torque + np.cross(palm(swings, time), force)
    acting[hand] = data.oMi[hand].actInv(pinocchio.Force(force, moment))
    return np.asarray(pinocchio.rnea(model, data, q, v, a, acting))[columns]


def left_out(at: list[float], frames: list[float]) -> list[float]:
    """Return the instants, every 10 ms, that have no load although the frames around them have no gap."""
    wanted, known = range(round(at[0] * 100), round(at[-1] * 100)), {round(time * 100) for time in at}
    times = np.array(frames)

    def followed(time: float) -> bool:
        near = times[np.abs(times - time) < WINDOW]
        return len(near) >= FEWEST and np.diff([time - WINDOW, *near, time + WINDOW]).max() < GAP - 1e-6

    return [number / 100 for number in wanted if number not in known and followed(number / 100)]


def held(nodes: Nodes, swings: Swings, run: TellsTime) -> tuple[Any, Publishes]:
    """Start the node, and the robot that holds the person's hand."""
    where = f"xyz: {list(BASE.position)}, xyzw: {list(BASE.orientation)}"
    process = begin(nodes, f"_force:={{source: robot, hand: right, {where}}}")
    topic = "/franka_state_controller/franka_states"
    return process, Publishes(run, topic, FrankaState, STATE_RATE, lambda time: robot_state(swings, time))


def worst_of_right_arm(tracked: list[Any], time: float) -> str:
    """Return the worst state that the tracker gave the joints between root and right hand in the window of a load."""
    near = [message for message in tracked if abs(message.header.stamp.to_sec() - time) < WINDOW + 1e-6]
    states = {message.state[joint] for message in near for joint in HAND.joints}
    states |= {message.root_state for message in near}
    return next(state for state in ("lost", "bridged", "measured") if state in states)


@pytest.mark.live
def test_what_their_muscles_do_comes_within_a_second_of_sixty_estimates_and_more(
    swings: Swings, nodes: Nodes, run: TellsTime, figure: Figure
) -> None:
    import rospy

    came: list[tuple[float, Any]] = []
    rospy.Subscriber("/hric/person/load", PersonLoad, lambda one: came.append((run.time, one)), queue_size=None)
    tracked, said = listen("/hric/person/tracking", PersonTracking), Diagnosis("person: load")
    process, robot = held(nodes, swings, run)
    wait(lambda: len(came) > 100 and {one.force for _, one in came[-50:]} == {"measured"})
    first, before, since = len(came), processor_time(process.pid), run.time
    wait(lambda: len(came) > first + 400)
    share = (processor_time(process.pid) - before) / (run.time - since)
    robot.close()
    settled = came[first : first + 400]
    figure("person with the load of their muscles, live at 120 Hz: share of a processor", share, "1")
    values = {pair.key: pair.value for pair in said.seen[-1].values}
    figure("person, load of their muscles alone: share of a processor", float(values["processor share [1]"]), "1")
    behind = np.array([when - one.header.stamp.to_sec() for when, one in settled])
    figure("person, load of their muscles: received so late, median", float(np.median(behind)), "s of robot time")
    figure("person, load of their muscles: received so late, at most", behind.max(), "s of robot time")
    assert behind.max() <= LATEST and max(one.behind for _, one in settled) <= LATEST
    begun, ended = (settled[k][1].header.stamp.to_sec() for k in (0, -1))
    rate = sum(begun <= message.header.stamp.to_sec() < ended for message in tracked) / (ended - begun)
    figure("person with the load of their muscles, live at 120 Hz: rate of estimates", rate, "Hz")
    assert rate >= 60.0 and said.says("the load is known")


def test_the_load_of_their_muscles_has_the_torque_of_an_independent_library(
    swings: Swings, nodes: Nodes, run: TellsTime, figure: Figure
) -> None:
    loads = listen("/hric/person/load", PersonLoad)
    torques, activations, reactions = (
        listen("/hric/person/joint_torque", JointTorque),
        listen("/hric/person/activation", MuscleActivation),
        listen("/hric/person/joint_reactions", JointReactions),
    )
    tracked = listen("/hric/person/tracking", PersonTracking)
    process, robot = held(nodes, swings, run)
    wait(lambda: len(loads) > 100 and {one.force for one in loads[-50:]} == {"measured"})
    first = len(loads)

    def whole() -> list[Any]:  # a busy machine drops frames, and says so
        return [one for one in loads[first:] if set(one.state) == {"measured"} and one.force == "measured"]

    wait(lambda: len(whole()) > 400)
    robot.close()
    settled = whole()[:400]
    at = [one.header.stamp.to_sec() for one in settled]
    came = [one.header.stamp.to_sec() for one in loads[first:] if one.header.stamp.to_sec() <= at[-1]]
    assert came == pytest.approx(np.round(came, 2), abs=1e-6)
    assert left_out(came, [message.header.stamp.to_sec() for message in tracked]) == []
    assert {(one.hand, one.force) for one in settled} == {("right", "measured")}
    assert max(one.distance for one in settled) < 0.02
    (order,) = {tuple(message.name) for message in torques}
    found = {message.header.stamp.to_sec(): message.torque for message in torques}
    expected = [needed(swings, time)[[JOINTS.index(name) for name in order]] for time in at[::10]]
    off = np.array([found[time] for time in at[::10]]) - expected
    rms = np.sqrt((off**2).mean(axis=0))
    figure("person, live joint torque against pinocchio: rms of the worst joint", rms.max(), "N m")
    assert rms.max() < 0.2
    instants = set(at)
    known = [message for message in activations if message.header.stamp.to_sec() in instants]
    values = np.array([message.activation for message in known])
    assert len(known) == len(at) and "right_bic_l" in known[0].name and np.isnan(known[0].excitation).all()
    assert values.min() >= 0.01 and values.max() <= 1.0 and values.max() > 0.1
    last = reactions[-1]
    assert last.joint_names == ["right_shoulder", "right_elbow", "left_shoulder", "left_elbow"]
    assert last.header.frame_id == "panda_link0" and last.wrenches[0].force.x != 0.0
    assert "Traceback" not in nodes.end(process)


def test_markers_that_are_lost_are_bridged_and_flagged_in_the_load_and_a_plate_that_stops_too(
    swings: Swings, nodes: Nodes, run: TellsTime
) -> None:
    loads, torques = listen("/hric/person/load", PersonLoad), listen("/hric/person/joint_torque", JointTorque)
    tracked = listen("/hric/person/tracking", PersonTracking)

    def pressed(time: float) -> Any:
        message = WrenchStamped()
        message.wrench.force.z = -30.0 - 5.0 * np.sin(time)
        return message

    x, y, z = palm(swings, 0.0).tolist()
    occluded = [[12.0 + 0.8 * k, (0.12, 0.6)[k % 2], "body"] for k in range(80)]
    process = begin(nodes, f"_force:={{source: plate, id: left, xyz: [{x}, {y}, {z}]}}", occlusions=occluded)
    topic = "/hric/perception/force_plate/left/wrench"
    plate = Publishes(run, topic, WrenchStamped, PLATE_RATE, pressed)
    wait(lambda: loads and loads[-1].force == "measured")
    on_hand = loads[-1].wrench.force
    time = loads[-1].header.stamp.to_sec()
    assert (on_hand.x, on_hand.y, on_hand.z) == pytest.approx((0.0, 0.0, 30.0 + 5.0 * np.sin(time)), abs=0.01)
    wait(lambda: {"bridged", "lost"} <= {one.state[0] for one in loads} and loads[-1].state[0] == "measured")
    wait(lambda: loads[-1].force == "measured")
    plate.close()
    wait(lambda: any(one.force == "missing" and one.state == ["lost", "measured"] for one in loads))
    assert "Traceback" not in nodes.end(process)
    known = {one.header.stamp.to_sec(): one.state[0] for one in loads if one.force == "measured"}
    assert known == {time: worst_of_right_arm(tracked, time) for time in known}
    assert set(known.values()) == {"measured", "bridged", "lost"}
    gone = {time for time, state in known.items() if state == "lost"}
    for message in torques:
        if message.header.stamp.to_sec() in gone:
            assert np.isnan(message.torque).all()
    assert all(np.isnan(one.wrench.force.z) for one in loads if one.force == "missing")
