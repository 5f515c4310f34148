"""Joint motors of the engine: velocity and position drives, and brakes."""

import math
from collections.abc import Sequence

import pybullet

from hric_control.plant import Mode
from pybullet_ros_control.engine import LoadedBody, PhysicsClient

BRAKE_FORCE = 1e6
"""Largest effort of a brake or an unlimited drive [N m]: a constraint, so its size does not make it stiff."""


class JointMotors:
    """Motors of all joints of a body, by their modes.

    Args:
        engine: the engine.
        body: the body.
        joints: engine indices.
        max_effort: largest effort of a drive, n floats [N m or N].
        max_velocity: largest speed of a position drive, n floats [rad/s or m/s].
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
        """Set new modes; a joint that is newly braked locks at q."""
        for i, (new, old) in enumerate(zip(modes, self.modes, strict=True)):
            if new is Mode.BRAKE and old is not Mode.BRAKE:
                self._lock[i] = q[i]
        self.modes = list(modes)
        self._sort()
        self.restore(self._body)

    def lock_at(self, q: Sequence[float]) -> None:
        """Lock braked joints at q, after the robot was put there from outside."""
        self._lock = list(q)
        self.restore(self._body)

    def restore(self, body: LoadedBody) -> None:
        """Send all motors to the engine, for example for a body that was loaded again."""
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
        """Return the target velocity of each drive in the next step, 0 for effort joints, n floats.

        A position drive is to arrive by the end of the step.
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
