"""Joint motors of PyBullet: velocity and position drives, and brakes."""

import math
from collections.abc import Sequence

import pybullet

from hric_control.plant import Mode
from pybullet_ros_control.engine import LoadedBody, PhysicsClient

BRAKE_FORCE = 1e6
"""Maximum effort of a brake, or of a drive without a limit [N m]; practically unlimited, no effect on stiffness."""


class JointMotors:
    """Motors of all moving joints of a body; each joint's mode is effort, velocity, position or brake.

    Args:
        engine: engine with the body.
        body: body with the joints.
        joints: engine indices of the joints.
        max_effort: maximum effort of a drive, n floats [N m or N].
        max_velocity: maximum speed of a position drive, n floats [rad/s or m/s].
    """

    def __init__(
        self,
        engine: PhysicsClient,
        body: LoadedBody,
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
        """Set the mode of each joint; a joint whose brake closes is locked at its position in q [rad or m]."""
        for i, (new, old) in enumerate(zip(modes, self.modes, strict=True)):
            if new is Mode.BRAKE and old is not Mode.BRAKE:
                self._lock[i] = q[i]
        self.modes = list(modes)
        self._sort()
        self.restore(self._body)

    def lock_at(self, q: Sequence[float]) -> None:
        """Lock braked joints at new positions q [rad or m], after the state was set from outside."""
        self._lock = list(q)
        self.restore(self._body)

    def restore(self, body: LoadedBody) -> None:
        """Send the settings of all motors to the engine, e.g. after the body was loaded again."""
        self._body = body
        for i, joint in enumerate(self._joints):
            common = {"physicsClientId": self._engine.client}
            if self.modes[i] is Mode.BRAKE:
                # A pure velocity motor would creep under load (1 mrad in 5 s); with a position gain it stays within
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
        """Return the target velocity of each drive in the next step, 0 for effort joints, n floats [rad/s or m/s].

        A position drive gets the velocity that leads to its target within the step, up to its limit.

        Args:
            q: present joint positions, n floats [rad or m].
            values: commands by the mode of each joint, n floats.
        """
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
        """Send the target velocities of the drives for the next step to the engine."""
        if self._driven:
            pybullet.setJointMotorControlArray(
                self._body.id,
                self._driven_joints,
                pybullet.VELOCITY_CONTROL,
                targetVelocities=[target_velocities[i] for i in self._driven],
                forces=[self._max_effort[i] for i in self._driven],
                physicsClientId=self._engine.client,
            )
