"""Joints of a model around the robot: common part of all engines."""

from collections.abc import Sequence

from hric_control.plants.config import PlantConfig
from hric_control.plants.moving_joints import Losses, MovingJoints
from hric_control.plants.stops import StopLaw
from hric_core import urdf


class DrivenJoints:
    """Moving joints of one model, driven by efforts; this class itself serves a model without moving joints.

    Args:
        model: name of the model.
        joints: its moving joints, all of them actuated.
        config: the plant's parameters.

    Attributes:
        joints: the moving joints.
        losses: their friction.
    """

    def __init__(self, model: str, joints: Sequence[urdf.Joint], config: PlantConfig) -> None:
        self.joints = MovingJoints(joints, [joint.name for joint in joints], model)
        rubs = config.friction == "coulomb"
        self.losses = [Losses(coulomb=joint.friction if rubs else 0.0, damping=joint.damping) for joint in joints]
        self._stops = StopLaw([(joint.lower, joint.upper) for joint in joints], self._inertias)
        zeros = self._efforts = self.joints.zeros
        self._start = self.joints.start(zeros, zeros, zeros)

    def _inertias(self) -> Sequence[float]:
        """Return the inertia that each joint moves [kg m^2 or kg]."""
        return []

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place [rad or m], [rad/s or m/s]."""
        q[:], dq[:] = (), ()

    def put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Put the joints at q, dq now and at each start. Raises CommandError if not one finite number per joint."""
        zeros = self.joints.zeros
        self._start = self.joints.start(q, zeros if dq is None else dq, zeros)
        self.begin()

    def begin(self) -> None:
        """Put the joints at the last set positions."""

    def drive(self, efforts: Sequence[float]) -> None:
        """Set the efforts from the next step on [N m or N]. Raises CommandError if not one per joint."""
        self._efforts = self.joints.command(efforts)

    def reset(self) -> None:
        """Return to the last set positions, without drive efforts."""
        self._efforts = self.joints.zeros
        self.begin()
