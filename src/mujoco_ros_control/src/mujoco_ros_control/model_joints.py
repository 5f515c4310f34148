"""Joints of the models around the robot (e.g. a human body): their positions, drives and stops in MuJoCo."""

from hric_control.plants import DrivenJoints, Model
from mujoco_ros_control.joints import make_joints
from mujoco_ros_control.robot import MujocoConfig
from mujoco_ros_control.scene import CompiledScene


class MujocoModelJoints(DrivenJoints):
    """Moving joints of one model in a MuJoCo scene.

    Args:
        model: model with the joints.
        config: parameters of the plant.

    Attributes:
        names: names of the joints in the scene, "model::joint".
    """

    def __init__(self, model: Model, config: MujocoConfig) -> None:
        super().__init__(model.name, [joint for joint in model.tree.joints.values() if joint.type != "fixed"], config)
        self.names, self._half = [f"{model.name}::{name}" for name in self.joints.names], config.half_step

    def bind(self, scene: CompiledScene) -> None:
        """Use a newly compiled scene, in which the joints already have their present positions."""
        self._scene, self._dofs, positions = scene, scene.dofs(self.names), scene.positions(self.names)
        self._engine = make_joints(scene.m, scene.d, self._dofs, positions, self.losses, self._half)

    def _inertias(self) -> list[float]:
        return self._scene.inertias(self._dofs)

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write joint positions and velocities at the measuring instant into the lists q and dq."""
        _, dq[:], q[:] = self._engine.read()

    def begin(self) -> None:
        """Set the joints in the engine to the stored start positions and velocities."""
        self._engine.put(*self._start)
        self._scene.d.qacc_warmstart[:] = 0.0
        self._stops.restart(self._engine.read()[0])

    def act(self) -> None:
        """Apply the efforts of drives and joint stops in the coming step, from the present positions."""
        stops = self._stops
        if stops.waiting or not self._engine.write_within(self._efforts, stops.low, stops.high):
            q, dq, _ = self._engine.read()
            self._engine.write(stops.add(q, dq, self._efforts))
