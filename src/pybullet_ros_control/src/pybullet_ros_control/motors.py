"""The engine's joint motors (velocity and position drives, and brakes) and joint stops."""

import math
from collections.abc import Sequence

import pybullet

from hric_control.plant import Mode
from hric_control.plants import StopMemory
from pybullet_ros_control.engine import Body, Engine

BRAKE_FORCE = 1e6
"""What a brake or a drive without effort limit may take [N m]: a constraint of the engine, so size does not make it
stiff."""
_FAR = 1e9
"""A bound that no joint reaches [rad or m]."""


class JointMotors:
    """Modes of all joints of a body.

    Args:
        joints: engine indices.
        max_effort: what a drive may take, n floats [N m or N].
        max_velocity: how fast a position drive goes, n floats [rad/s or m/s].
    """

    def __init__(
        self,
        engine: Engine,
        body: Body,
        joints: Sequence[int],
        max_effort: Sequence[float],
        max_velocity: Sequence[float],
    ) -> None:
        self._engine, self._body, self._joints = engine, body, list(joints)
        self._max_effort = [min(effort, BRAKE_FORCE) for effort in max_effort]
        self._max_velocity = list(max_velocity)
        self.modes = [Mode.EFFORT] * len(self._joints)
        self._lock = [0.0] * len(self._joints)
        self._sort()
        self.restore(body)

    def _sort(self) -> None:
        modes = self.modes
        self.all_effort = all(mode is Mode.EFFORT for mode in modes)
        self.effort = [i for i, mode in enumerate(modes) if mode is Mode.EFFORT]
        self.effort_joints = [self._joints[i] for i in self.effort]
        self._driven = [i for i, mode in enumerate(modes) if mode in (Mode.VELOCITY, Mode.POSITION)]
        self._driven_joints = [self._joints[i] for i in self._driven]

    def set_modes(self, modes: Sequence[Mode], q: Sequence[float]) -> None:
        """New modes; a joint that is braked now locks at q."""
        for i, (new, old) in enumerate(zip(modes, self.modes, strict=True)):
            if new is Mode.BRAKE and old is not Mode.BRAKE:
                self._lock[i] = q[i]
        self.modes = list(modes)
        self._sort()
        self.restore(self._body)

    def lock_at(self, q: Sequence[float]) -> None:
        """The robot was put at q from outside: brakes hold there."""
        self._lock = list(q)
        self.restore(self._body)

    def restore(self, body: Body) -> None:
        """Send the engine all motors, for example of a body that was loaded again."""
        self._body = body
        for i, joint in enumerate(self._joints):
            common = {"physicsClientId": self._engine.client}
            if self.modes[i] is Mode.BRAKE:
                # A bare velocity motor would creep under load (1 mrad in 5 s); holding the position too keeps it within
                # 1 urad.
                pybullet.setJointMotorControl2(
                    body.id,
                    joint,
                    pybullet.POSITION_CONTROL,
                    targetPosition=self._lock[i],
                    positionGain=1.0,
                    velocityGain=1.0,
                    force=BRAKE_FORCE,
                    **common,
                )
            else:
                force = 0.0 if self.modes[i] is Mode.EFFORT else self._max_effort[i]
                pybullet.setJointMotorControl2(
                    body.id, joint, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=force, **common
                )

    def target_velocities(self, q: Sequence[float], values: Sequence[float]) -> list[float]:
        """Velocity that each drive aims at in the next step; a position drive aims at arriving. n floats (effort
        joints: 0)."""
        dt = self._engine.time_step
        target = [0.0] * len(self._joints)
        for i, mode in enumerate(self.modes):
            if mode is Mode.VELOCITY:
                target[i] = values[i]
            elif mode is Mode.POSITION or mode is Mode.BRAKE:
                aim = self._lock[i] if mode is Mode.BRAKE else values[i]
                limit = math.inf if mode is Mode.BRAKE else self._max_velocity[i]
                target[i] = min(max((aim - q[i]) / dt, -limit), limit)
        return target

    def drive(self, target_velocities: Sequence[float]) -> None:
        """Send the drives' targets for the next step."""
        if self._driven:
            pybullet.setJointMotorControlArray(
                self._body.id,
                self._driven_joints,
                pybullet.VELOCITY_CONTROL,
                targetVelocities=[target_velocities[i] for i in self._driven],
                forces=[self._max_effort[i] for i in self._driven],
                physicsClientId=self._engine.client,
            )


class JointStops:
    """Both stops of each joint. The engine has them; what it lacks is a start outside the range, as the thesis does at
    q = 0: a stop that the joint started beyond is left open until the joint has been inside.

    Args:
        joints: engine indices.
        limits: (lower, upper) per joint [rad or m], infinite where there is no stop.
    """

    def __init__(
        self, engine: Engine, body: Body, joints: Sequence[int], limits: Sequence[tuple[float, float]]
    ) -> None:
        self._engine, self._body = engine, body
        self._joints, self._memory = list(joints), StopMemory(limits)

    @property
    def waiting(self) -> bool:
        """Whether a stop is open."""
        return bool(self._memory.waiting)

    def put(self, q: Sequence[float]) -> None:
        """The robot was put at q from outside: decide again which stops act."""
        for i in self._memory.restart(q):
            self._send(i)

    def restore(self, body: Body) -> None:
        """The body was loaded again, with all stops acting: open the waiting ones again."""
        self._body = body
        for i in self._memory.waiting:
            self._send(i)

    def check(self, q: Sequence[float]) -> None:
        """Let a waiting stop act as soon as the joint is inside its range."""
        for i in self._memory.check(q):
            self._send(i)

    def _send(self, i: int) -> None:
        low, high = self._memory.limits[i]
        below, above = self._memory.waiting.get(i, (False, False))
        pybullet.changeDynamics(
            self._body.id,
            self._joints[i],
            jointLowerLimit=-_FAR if below else low,
            jointUpperLimit=_FAR if above else high,
            physicsClientId=self._engine.client,
        )
