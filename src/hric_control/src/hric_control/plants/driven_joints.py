"""Joints of an articulated model in the robot's surroundings: part that is common to all engines."""

from collections.abc import Sequence

from hric_control.plants.config import PlantConfig
from hric_control.plants.moving_joints import Losses, MovingJoints
from hric_control.plants.stops import StopLaw
from hric_core import urdf


class DrivenJoints:
    """Moving joints of one model, driven by efforts. This base class is used for a model without moving joints.

    Args:
        model: name of the model.
        joints: moving joints of the model, all of them actuated.
        config: the plant's parameters.

    Attributes:
        joints: the moving joints.
        losses: friction of the moving joints.
    """

    def __init__(self, model: str, joints: Sequence[urdf.Joint], config: PlantConfig) -> None:
        self.joints = MovingJoints(joints, [joint.name for joint in joints], model)
        rubs = config.friction == "coulomb"
        self.losses = [Losses(coulomb=joint.friction if rubs else 0.0, damping=joint.damping) for joint in joints]
        self._stops = StopLaw([(joint.lower, joint.upper) for joint in joints], self._inertias)
        zeros = self._efforts = self.joints.zeros
        self._start = self.joints.start(zeros, zeros, zeros)

    def _inertias(self) -> Sequence[float]:
        """Return the effective inertia at each joint, n floats [kg m^2 or kg]."""
        return []

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write joint positions q [rad or m] and velocities dq [rad/s or m/s] into the lists, in place."""
        q[:], dq[:] = (), ()

    def put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Set the joint positions q and velocities dq (None: zero), now and after each reset.

        Raises CommandError unless there is one finite number per joint."""
        zeros = self.joints.zeros
        self._start = self.joints.start(q, zeros if dq is None else dq, zeros)
        self.begin()

    def begin(self) -> None:
        """Set the joints to the state of the last `put`, at first zero."""

    def drive(self, efforts: Sequence[float]) -> None:
        """Set the joint efforts from the next step on [N m or N]. Raises CommandError unless there is one per joint."""
        self._efforts = self.joints.command(efforts)

    def reset(self) -> None:
        """Set the joints to the state of the last `put`, at first zero, and their efforts to zero."""
        self._efforts = self.joints.zeros
        self.begin()
