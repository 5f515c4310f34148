"""Joints of the models around the robot: their positions, drives and stops."""

from collections.abc import Sequence

from hric_control.plants import Losses, Model, MovingJoints, StopLaw
from mujoco_ros_control.joints import make_joints
from mujoco_ros_control.robot import MujocoConfig
from mujoco_ros_control.scene import Scene


class ModelJoints:
    """Moving joints of one model.

    Args:
        model: model of the joints.
        config: the plant's parameters.

    Attributes:
        joints: joints of the description, all of them actuated.
        losses: losses by "model::joint", for the scene.
    """

    def __init__(self, model: Model, config: MujocoConfig) -> None:
        moving = [joint for joint in model.tree.joints.values() if joint.type != "fixed"]
        names = [joint.name for joint in moving]
        self.joints, self._half = MovingJoints(moving, names, model.name), config.half_step
        rubs = config.friction == "coulomb"
        self.losses = {
            f"{model.name}::{joint.name}": Losses(coulomb=joint.friction if rubs else 0.0, damping=joint.damping)
            for joint in moving
        }
        self._stops = StopLaw([(joint.lower, joint.upper) for joint in moving], self._inertias)
        zeros = self._efforts = self.joints.zeros
        self._start = self.joints.start(zeros, zeros, zeros)

    def bind(self, scene: Scene) -> None:
        """Bind to another scene, which already has the joints' present positions."""
        names = list(self.losses)
        self._scene, self._dofs, positions = scene, scene.dofs(names), scene.positions(names)
        self._engine = make_joints(scene.m, scene.d, self._dofs, positions, list(self.losses.values()), self._half)

    def _inertias(self) -> list[float]:
        return self._scene.inertias(self._dofs)

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place."""
        _, dq[:], q[:] = self._engine.read()

    def put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Put the joints at q, dq now and at each start. Raises CommandError if not one finite number per joint."""
        zeros = self.joints.zeros
        self._start = self.joints.start(q, zeros if dq is None else dq, zeros)
        self.begin()

    def drive(self, efforts: Sequence[float]) -> None:
        """Set the efforts from the next step on [N m or N]. Raises CommandError if not one per joint."""
        self._efforts = self.joints.command(efforts)

    def reset(self) -> None:
        """Return to the last set positions, without drive efforts."""
        self._efforts = self.joints.zeros
        self.begin()

    def begin(self) -> None:
        """Put the joints at the last set positions."""
        self._engine.put(*self._start)
        self._scene.d.qacc_warmstart[:] = 0.0
        self._stops.restart(self._engine.read()[0])

    def act(self) -> None:
        """Apply drives and stops in the coming step, from the present positions."""
        q, dq, _ = self._engine.read()
        self._engine.write(self._stops.add(q, dq, self._efforts))
