"""Pictures of a simulation, drawn by MuJoCo without a display."""

from hric_control.sim.simulated_robot import SimulatedRobot
from hric_human.participant.settings import HUMAN, HumanSettings
from hric_run.definition.experiment import Experiment
from hric_run.observation import SimulationState
from mujoco_ros_control.pictures import Camera, CameraSettings

VIEW = {"width": 640, "height": 480, "xyz": [0.7, -3.2, 1.1], "rpy": [0.0, 0.25, 1.5708]}
"""Size of the pictures [pixels] and pose of the camera in the world [m], [rad]."""


class Renderer:
    """Camera at the fixed pose VIEW that draws arm, person and objects.

    Args:
        hw: the simulated robot.
        definition: experiment with the world file and the person.

    Raises:
        HricError: OpenGL is not available.
    """

    def __init__(self, hw: SimulatedRobot, definition: Experiment) -> None:
        self._plant, self._names = hw.plant, hw.states.names
        person = None if definition.human is None else HumanSettings.of(definition.human, HUMAN)
        settings = CameraSettings.of(VIEW, "camera")
        self._camera = Camera(hw.description, str(definition.robot.plant.get("world", "")), settings, person)

    def picture(self, observation: SimulationState) -> object:
        """Return the picture of an observation, uint8, shape (480, 640, 3)."""
        plant, person = self._plant, observation.person
        poses = {name: plant.link_state(f"{name}::{plant.base_link(name)}")[0] for name in plant.model_names()}
        if person is not None:
            poses[HUMAN] = person.T_world_root
        joints = {} if person is None else dict(zip(person.joints, person.q.tolist(), strict=True))
        robot = dict(zip(self._names, observation.arm.q.tolist(), strict=True))
        return self._camera.take(robot, poses, joints, depth=False)[0]

    def close(self) -> None:
        """Release the OpenGL context."""
        self._camera.close()
