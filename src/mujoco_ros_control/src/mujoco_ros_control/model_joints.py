"""The joints of a model beside the robot: where they are, what drives them, and their stops."""

from collections.abc import Sequence

from hric_control.plants import Losses, Model, MovingJoints, StopLaw
from mujoco_ros_control.joints import make_joints
from mujoco_ros_control.robot import MujocoConfig
from mujoco_ros_control.scene import Scene


class ModelJoints:
    """The moving joints of one model.

    Args:
        model: whose they are.
        config: the plant's parameters.

    Attributes:
        joints: the description's, all of them actuated.
        losses: by "model::joint", for the scene.
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
        """Another scene, in which the joints are already where they shall go on."""
        names = list(self.losses)
        self._scene, self._dofs, positions = scene, scene.dofs(names), scene.positions(names)
        self._engine = make_joints(scene.m, scene.d, self._dofs, positions, list(self.losses.values()), self._half)

    def _inertias(self) -> list[float]:
        return self._scene.inertias(self._dofs)

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place."""
        _, dq[:], q[:] = self._engine.read()

    def put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Be at q, dq now and at the start. Raises CommandError where they are not one finite number per joint."""
        zeros = self.joints.zeros
        self._start = self.joints.start(q, zeros if dq is None else dq, zeros)
        self.begin()

    def drive(self, efforts: Sequence[float]) -> None:
        """From the next step on [N m or N]. Raises CommandError where they are not as many as joints."""
        self._efforts = self.joints.command(efforts)

    def reset(self) -> None:
        """Be where they were put last, without a drive."""
        self._efforts = self.joints.zeros
        self.begin()

    def begin(self) -> None:
        """Be where they were put last."""
        self._engine.put(*self._start)
        self._scene.d.qacc_warmstart[:] = 0.0
        self._stops.restart(self._engine.read()[0])

    def act(self) -> None:
        """Drives and stops in the coming step; positions are those of now."""
        q, dq, _ = self._engine.read()
        self._engine.write(self._stops.add(q, dq, self._efforts))
