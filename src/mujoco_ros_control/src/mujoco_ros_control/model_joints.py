"""Joints of the models around the robot: their positions, drives and stops."""

from hric_control.plants import DrivenJoints, Model
from mujoco_ros_control.joints import make_joints
from mujoco_ros_control.robot import MujocoConfig
from mujoco_ros_control.scene import CompiledScene


class MujocoModelJoints(DrivenJoints):
    """Moving joints of one model in a scene.

    Args:
        model: model of the joints.
        config: the plant's parameters.

    Attributes:
        names: names of the joints in the scene, "model::joint".
    """

    def __init__(self, model: Model, config: MujocoConfig) -> None:
        super().__init__(model.name, [joint for joint in model.tree.joints.values() if joint.type != "fixed"], config)
        self.names, self._half = [f"{model.name}::{name}" for name in self.joints.names], config.half_step

    def bind(self, scene: CompiledScene) -> None:
        """Bind to another scene, which already has the joints' present positions."""
        self._scene, self._dofs, positions = scene, scene.dofs(self.names), scene.positions(self.names)
        self._engine = make_joints(scene.m, scene.d, self._dofs, positions, self.losses, self._half)

    def _inertias(self) -> list[float]:
        return self._scene.inertias(self._dofs)

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place."""
        _, dq[:], q[:] = self._engine.read()

    def begin(self) -> None:
        """Put the joints at the last set positions."""
        self._engine.put(*self._start)
        self._scene.d.qacc_warmstart[:] = 0.0
        self._stops.restart(self._engine.read()[0])

    def act(self) -> None:
        """Apply drives and stops in the coming step, from the present positions."""
        q, dq, _ = self._engine.read()
        self._engine.write(self._stops.add(q, dq, self._efforts))
