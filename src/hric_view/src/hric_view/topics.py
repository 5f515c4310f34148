"""Construction of the parts of the window on a running system, with their subscriptions."""

from functools import partial

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from control_msgs.msg import JointTrajectoryControllerState
from franka_msgs.msg import FrankaState
from hric_assessment.contact.limits import Limits
from hric_bags.run_file import RunFile
from hric_control.limits import load_limits
from hric_core.node import Node
from hric_core.urdf import read
from hric_human.participant.settings import HUMAN
from hric_msgs.msg import (
    ClockPair,
    MocapData,
    MuscleActivation,
    RegionContacts,
    SafetyState,
    SampleChunk,
)
from hric_report.html.scene import SceneRobot
from hric_view.feeds import Feeds
from hric_view.page import Part
from hric_view.parts import LiveHand, LiveMocap, LiveMuscles, LivePlates, LiveStatics, LiveTouches
from hric_view.readings import SETPOINTS, LiveEmg, LiveLimits, LivePace, LiveSafety, LiveSetpoint
from hric_view.verdict import ARM, PERSON, LiveVerdict


def of_arm(root: Node, feeds: Feeds, arm: SceneRobot, rate: float) -> list[Part]:
    """Return the parts that show the arm and the sensors, and subscribe to their topics.

    Args:
        root: node in the namespace of the robot.
        feeds: topics of the window.
        arm: the arm in the scene.
        rate: rate of the frames [Hz of wall time].
    """
    tree = read(arm.description)
    hand = LiveHand(next((name for name in tree.links if name.endswith("_link0")), tree.root))
    statics = LiveStatics(list(tree.links), lambda plate: _add_plate(feeds, plates, plate))
    mocap, plates, emg, safety = LiveMocap(statics), LivePlates(statics), LiveEmg(rate), LiveSafety()
    pace = LivePace()
    limits = {joint.name: joint for joint in load_limits(arm.description, root, _turning(arm))}
    efforts, setpoint = LiveLimits(arm.joint_names, limits), LiveSetpoint(arm.joint_names)
    root.subscribe("/tf_static", TFMessage, statics.push, queue_size=100)
    feeds.show("franka_state_controller/franka_states", FrankaState, hand.push)
    feeds.show("hric/perception/mocap", MocapData, mocap.push)
    feeds.show("joint_states", JointState, efforts.push, depth=10)
    feeds.show("hric/perception/emg/envelope", SampleChunk, emg.push, depth=100)
    feeds.show("hric/safety/state", SafetyState, safety.push)
    feeds.show("hric/clock", ClockPair, pace.push)
    for name in SETPOINTS:
        feeds.show(f"{name}/state", JointTrajectoryControllerState, setpoint.push)
    return [hand, mocap, plates, efforts, setpoint, emg, safety, pace]


def of_person(root: Node, feeds: Feeds, person: SceneRobot) -> list[Part]:
    """Return the parts that show muscles and contacts of the simulated person, and subscribe to their topics.

    Args:
        root: node in the namespace of the robot.
        feeds: topics of the window.
        person: the person in the scene, to which the lines of the muscles are added.
    """
    touches = LiveTouches(Limits.named())
    feeds.show(f"hric/{HUMAN}/contacts", RegionContacts, touches.push, depth=100)
    if not (lines := root.param(f"hric/{HUMAN}/muscle_lines", {})):
        return [touches]
    muscles = LiveMuscles(lines)
    person.lines = muscles.lines
    feeds.show(f"hric/{HUMAN}/activation", MuscleActivation, muscles.push)
    return [touches, muscles]


def verdict(root: Node, feeds: Feeds, arm: SceneRobot) -> LiveVerdict:
    """Return the part with the verdict on the simulated person next to an arm, and subscribe to the topics of both.

    Args:
        root: node in the namespace of the robot.
        feeds: topics of the window.
        arm: the arm in the scene.
    """
    human = {key: value for key, value in root.param(f"robot/participants/{HUMAN}", {}).items() if key != "type"}
    parameters = {"robot": {"plant": root.param("robot/plant", {})}}
    run: RunFile = {"definition": {"human": human or None}, "parameters": parameters}
    name = root.resolve(f"hric/{HUMAN}")
    so_far = LiveVerdict(arm.description, _turning(arm), run, name)
    for topic, kind in [(ARM, JointState), *((f"{name}/{end}", kind) for end, kind in PERSON.items())]:
        feeds.keep(topic, kind, partial(so_far.push, topic))
    return so_far


def _turning(arm: SceneRobot) -> list[str]:
    return [joint.name for joint in read(arm.description).joints.values() if joint.type == "revolute"]


def _add_plate(feeds: Feeds, plates: LivePlates, plate: str) -> None:
    feeds.show(f"hric/perception/force_plate/{plate}/wrench", WrenchStamped, plates.add(plate))
