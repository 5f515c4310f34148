"""Node `window`: the window of a running system in a browser."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from hric_core.parameters import Settings, flag, number, text, whole
from hric_core.ros import RosNode
from hric_core.ros.process import NodeApp
from hric_core.urdf import mimic_laws, read
from hric_human.participant.settings import HUMAN, HumanSettings
from hric_msgs.msg import RegionContacts
from hric_report.html.scene import SceneRobot, SceneSkin
from hric_skin import fitted
from hric_view import page, topics, world
from hric_view.control_node import controls_of
from hric_view.feeds import Feeds
from hric_view.live import LiveForces, LiveJoints
from hric_view.page import Part
from hric_view.server import LOOPBACK, ViewServer, Visit, WebPage


@dataclass(frozen=True)
class WindowSettings(Settings):
    """Parameters of the node."""

    host: str = text(LOOPBACK, empty=False, text="address of this machine on which the window listens")
    port: int = whole(
        0, minimum=0, maximum=65535, text="TCP port of the window; 0: 8090, or a free one if 8090 is taken"
    )
    rate: float = number(30.0, minimum=1.0, maximum=120.0, unit="Hz", text="rate of the frames, in wall time")
    control: bool = flag(False, text="execute commands from the page; the page is not a safety stop")
    robot_description: str = text("robot_description", empty=False, text="parameter with the URDF of the arm")


class BrowserWindow(NodeApp):
    """Window node; it listens from construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, the port is taken, or a description cannot be read.
    """

    def __init__(self, node: RosNode) -> None:
        settings = WindowSettings.read(node)
        self._root, self._robots = RosNode(), list[SceneRobot]()
        self._feeds = Feeds(self._root)
        self._joints, self._forces = list[LiveJoints](), LiveForces()
        self._parts: list[Part] = [self._forces]
        self._stop, self._period = threading.Event(), 1.0 / settings.rate
        self._watching: list[Callable[[threading.Event, Callable[[], bool]], None]] = []
        self._add(str(self._root.param(settings.robot_description)), "joint_states", depth=10)  # arm and hand in turn
        if self._root.has_param(f"hric/{HUMAN}/robot_description"):
            self._add_human()
        for robot, live in world.objects(self._root, self._feeds):
            self._robots.append(robot)
            self._joints.append(live)
        self._parts += topics.of_arm(self._root, self._feeds, self._robots[0], settings.rate)
        self._title = f"{self._root.namespace.strip('/') or 'robot'}, live"
        self._controls = None
        if settings.control:
            self._controls, actions = controls_of(self._root, self._feeds, self._robots[0].description, self._joints[0])
            self._parts.append(self._controls)
            self._watching.append(actions.watch)
        self._server = ViewServer(self, settings.host, settings.port, self._controls)
        self._root.set_param("hric/view/address", self._server.address)
        rospy.loginfo("The window is open at %s", self._server.address)
        self._thread = threading.Thread(target=self._run, name="frames", daemon=True)
        self._thread.start()
        for watch in self._watching:
            arguments = (self._stop, lambda: bool(self._server.viewers))
            threading.Thread(target=watch, args=arguments, name=watch.__qualname__, daemon=True).start()

    def close(self) -> None:
        """Stop sending and listening."""
        self._stop.set()
        self._thread.join()
        self._server.close()

    def page(self, visit: Visit) -> WebPage | None:
        """Return the page at the address "/"; None: another address."""
        control = self._controls is not None
        return page.render(self._title, visit, control=control, live=True) if visit.path == "/" else None

    def scene(self, visit: Visit) -> str:
        """Return the first message of a viewer: all robots and persons, and the data of all parts."""
        return page.scene_message(self._robots, self._parts, live=True)

    def _add(self, description: str, topic: str, depth: int) -> SceneRobot:
        """Add a robot or person to the scene.

        Args:
            description: URDF of the robot or person.
            topic: topic with its joint states.
            depth: largest number of messages that a frame reads, 1 or more if several nodes publish on the topic.
        """
        joints = read(description).joints
        laws = mimic_laws(joints)
        names = tuple(joint.name for joint in joints.values() if joint.type != "fixed" and joint.name not in laws)
        live = LiveJoints(names)
        self._joints.append(live)
        self._feeds.show(topic, JointState, live.push, depth=depth, lasting=True)
        robot = SceneRobot("", description, names, np.zeros(1), np.zeros((1, len(names))))
        self._robots.append(robot)
        return robot

    def _add_human(self) -> None:
        """Add the simulated person, with their skin and the forces on them."""
        description = str(self._root.param(f"hric/{HUMAN}/robot_description"))
        robot = self._add(description, f"hric/{HUMAN}/joint_states", depth=1)
        if (settings := HumanSettings.beside_robot(self._root)) is not None:
            body = settings.body()
            robot.pose, robot.skin = settings.root(body), SceneSkin.of(fitted(body, settings.gripping(body)))
        self._feeds.show(f"hric/{HUMAN}/root", PoseStamped, self._joints[-1].push_root, lasting=True)
        self._feeds.show(f"hric/{HUMAN}/contacts", RegionContacts, self._forces.push, depth=100)
        verdict = topics.verdict(self._root, self._feeds, self._robots[0])
        self._parts += [*topics.of_person(self._root, self._feeds, robot), verdict]
        self._watching.append(verdict.watch)

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.wait(due - time.monotonic()):
            due = max(due + self._period, time.monotonic())  # what a frame takes is not part of the period
            if self._server.viewers:
                self._feeds.deliver()
                self._server.send(page.frame_message(self._joints, self._parts))
