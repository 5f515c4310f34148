"""External forces of a step (contact, wrenches) as joint efforts of an OpenSim robot, and the loads in its joints."""

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby

import numpy as np

from hric_control.plant import Contact, JointReaction, Surface
from hric_control.plants import ContactLaw, Springs, Wrenches, combine
from hric_control.plants.faces import centre
from hric_core.geometry.transforms import FloatArray, cross
from opensim_ros_control.bodies import BodyForce, Kinematics, Reactions
from opensim_ros_control.collision import MARGIN, Collider, Collisions, Meeting
from opensim_ros_control.contact import ContactPoint, RigidContact, push_apart
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.robot import OpenSimRobot


class Forces:
    """Contact and wrenches of each step, computed at its start and constant over it.

    Call `bind` before the first step and after each new build of the robot's model.

    Args:
        robot: robot that gets the joint efforts of these forces.
        R_ground_world: rotation of the world in OpenSim's ground, shape (3, 3).
        wrenches: wrenches that users of the plant apply.
        springs: contact springs of penalty contact, with their state.
    """

    def __init__(self, robot: OpenSimRobot, R_ground_world: FloatArray, wrenches: Wrenches, springs: Springs) -> None:
        config = robot.config
        self._robot, self._R, self._dt = robot, R_ground_world, config.time_step
        self._wrenches, self._springs = wrenches, springs
        self._accurate = config.integrator == "accurate"
        # Time to the middle of the step; semi-implicit positions are already there.
        self._ahead = 0.5 * self._dt if self._accurate else 0.0
        self._rigid = RigidContact(self._dt)
        self.forget()

    def forget(self) -> None:
        """Clear contacts, the state of contact springs and the previous step, after bodies were repositioned."""
        self._rigid.forget()
        self._springs.forget()
        self._points: list[ContactPoint] = []
        self._pushed: list[BodyForce] = []
        self._before: FloatArray | None = None

    def bind(
        self, kinematics: Kinematics, collisions: Collisions, surfaces: Mapping[str, Surface], reactions: Reactions
    ) -> None:
        """Use a new build of the model.

        Args:
            kinematics: kinematics of the build.
            collisions: detector of contact.
            surfaces: surfaces by "model::link".
            reactions: computation of joint loads.
        """
        self._kinematics, self._reactions, self._surfaces = kinematics, reactions, surfaces
        self.look_at(collisions)
        self._laws: dict[tuple[str, str], tuple[ContactLaw | None, float]] = {}
        self._points, self._pushed, self._before = [], [], None

    def look_at(self, collisions: Collisions) -> None:
        """Use another contact detector, after the pairs of links that may touch have changed."""
        self._collisions = collisions

    def act(self, frame: Callable[[str], str], held: FloatArray | None) -> None:
        """Compute contact and wrenches of the coming step, and set their joint efforts in the robot.

        Args:
            frame: function that returns the engine's frame name of "model::link".
            held: joint efforts to add, of bushings and models' joints, shape (nu,) [N m or N]; None: no efforts.
        """
        robot = self._robot
        before, self._before = self._before, robot.y
        self._springs.begin()
        self._points, self._pushed = [], []
        robot.touch, robot.external = None, held
        near = self._collisions.near(robot.y[: robot.engine.nu]) if self._collisions.pairs else []
        if not near and not self._wrenches.active:
            return
        engine = robot.engine
        engine.put_y(robot.y)
        engine.model.realizePosition(engine.system_state)
        self._kinematics.forget()
        efforts = self._wrench_efforts(engine, frame)
        if near:
            self._meet(near)
            soft = [point for point in self._points if point.law[0] is not None]
            hard = [point for point in self._points if point.law[0] is None]
            if soft:
                speeds = slice(engine.nu, 2 * engine.nu)
                u = robot.y[speeds]
                efforts += push_apart(soft, u, u if before is None else before[speeds], robot.response(), self._springs)
            if hard:
                robot.touch = lambda v, gain: self._rigid.solve(hard, v, gain)
        if self._points or self._wrenches.active:
            robot.external = efforts if held is None else efforts + held
        self._wrenches.count_step()

    def _wrench_efforts(self, engine: OpenSimEngine, frame: Callable[[str], str]) -> FloatArray:
        efforts = np.zeros(engine.nu)
        for wrench in self._wrenches.active:
            number, T_body_link = self._kinematics.carrier(engine.frame(frame(wrench.body)))
            T = self._kinematics.pose(number) @ T_body_link
            load = BodyForce(
                number, T[:3, :3] @ wrench.point + T[:3, 3], self._R @ wrench.force, self._R @ wrench.torque
            )
            efforts += self._kinematics.jacobian(number, load.position).T @ np.concatenate([load.torque, load.force])
            self._pushed.append(load)
        return efforts

    def _law(self, a: Collider, b: Collider) -> tuple[ContactLaw | None, float]:
        """Return the contact law of two colliders, None for rigid contact, and their friction coefficient [1]."""
        pair = (a.link, b.link)
        if pair not in self._laws:
            first, second = self._surfaces[a.link], self._surfaces[b.link]
            links = [link.partition("::")[2] for link in pair]
            inside = a.model == b.model and not self._robot.model.robot.apart(*links)
            law = None if inside else combine(first, second)  # within an arm contact is rigid
            self._laws[pair] = law or (None, first.friction * second.friction)
        return self._laws[pair]

    def _meet(self, near: Sequence[int]) -> None:
        """Compute all contact points of this step; near: indices of the pairs of colliders to check."""
        unsorted = self._collisions.meetings(near, self._kinematics.pose, lambda a, b: self._law(a, b)[0] is None)
        meetings = sorted(unsorted, key=lambda m: (m.a.link, m.b.link))
        for _, group in groupby(meetings, key=lambda m: (m.a.link, m.b.link)):
            of_links = list(group)
            law = self._law(of_links[0].a, of_links[0].b)
            if law[0] is not None:
                self._add_spring(of_links, law)
                continue
            for number, meeting in enumerate(of_links):
                for k, (point, depth) in enumerate(self._collisions.depths(meeting)):
                    if depth > -MARGIN:
                        self._add(meeting.a, meeting.b, (point, meeting.touch.normal, depth), law, (number, k))

    def _add_spring(self, meetings: Sequence[Meeting], law: tuple[ContactLaw | None, float]) -> None:
        """Add one spring for a pair of links, so that several shapes do not make a link stiffer."""
        deepest = max(meetings, key=lambda m: m.touch.depth)
        normal = sum((max(m.touch.depth, 0.0) * m.touch.normal for m in meetings), np.zeros(3))
        size = float(np.linalg.norm(normal))
        normal = normal / size if size > 0.0 else deepest.touch.normal
        corners = [corner for m in meetings for corner in self._collisions.corners(m, self._kinematics.pose)]
        a, b, engine = deepest.a, deepest.b, self._robot.engine
        jacobian, first = self._kinematics.jacobian, corners[0].position
        relative = jacobian(a.mobile, first) - jacobian(b.mobile, first)
        angular, linear = (relative @ self._robot.y[engine.nu : 2 * engine.nu]).reshape(2, 3)
        # n . (omega x r) = r . (n x omega)
        pace, lever = float(linear @ normal), cross(normal, angular)
        closing = [-pace - float((c.position - first) @ lever) for c in corners]
        position, depth = centre(corners, closing, self._ahead)
        self._add(a, b, (position, normal, depth), law, ())

    def _add(
        self,
        a: Collider,
        b: Collider,
        where: tuple[FloatArray, FloatArray, float],
        law: tuple[ContactLaw | None, float],
        key: tuple[int, ...],
    ) -> None:
        """Add a contact point between two colliders.

        Args:
            a: first collider.
            b: second collider.
            where: (position [m], normal from b to a, depth [m]).
            law: contact law.
            key: identifies the point among those of the two links.
        """
        J, bodies = self._relative(a, b, where[0]), (a.mobile, b.mobile)
        self._points.append(ContactPoint(a.link, b.link, bodies, *where, J, law, (a.link, b.link, *key), np.zeros(3)))

    def _relative(self, a: Collider, b: Collider, point: FloatArray) -> FloatArray:
        """Return the Jacobian of the velocity of collider a relative to b at a point [m], shape (3, nu)."""
        if b.mobile == 0:
            return self._kinematics.jacobian(a.mobile, point)[3:]
        J_b = self._kinematics.jacobian(b.mobile, point)[3:]
        return -J_b if a.mobile == 0 else self._kinematics.jacobian(a.mobile, point)[3:] - J_b

    # -- results of the step -------------------------------------------------------------------------------------------

    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step that carry a force or overlap."""
        R = self._R.T
        result = []
        for point in self._points:
            force, soft, mean = point.normal_force, point.law[0] is not None, float(point.force @ point.normal)
            if mean > 0.0 or (point.depth > 0.0 and not soft):
                p, n = (R @ point.position).tolist(), (R @ point.normal).tolist()
                kind = "penalty" if soft else "rigid"
                result.append(
                    Contact(
                        point.a,
                        point.b,
                        (p[0], p[1], p[2]),
                        (n[0], n[1], n[2]),
                        point.depth,
                        force,
                        kind,
                        self._dt * mean,
                        point.closing,
                        point.energy,
                    )
                )
        return result

    def reactions(self, held: Sequence[BodyForce]) -> list[JointReaction]:
        """Return force and torque in each moving joint of the robot in the last step.

        Empty before the first step of a build. The acceleration is the mean over the step. It is combined with the
        state at the middle of the step (accurate integrator, error of second order) or at its start (semi-implicit).

        Args:
            held: loads on the bodies beside contact and wrenches, i.e. of bushings.
        """
        before, after, n = self._before, self._robot.y, self._robot.engine.nu
        if before is None or before is after:
            return []
        du = (after[n : 2 * n] - before[n : 2 * n]) / self._dt
        outside = [*self._pushed, *held]
        for point in self._points:
            for number, sign in zip(point.bodies, (1.0, -1.0), strict=True):
                outside.append(BodyForce(number, point.position, sign * point.force, np.zeros(3)))
        return self._reactions.loads(0.5 * (before + after) if self._accurate else before, du, outside, self._R)
