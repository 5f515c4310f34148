"""World in MuJoCo: the robot, the objects of the world file and the models that are spawned later, in one scene."""

from collections.abc import Collection, Mapping, Sequence

import mujoco

from hric_control.plants import Model, Models, Surfaces, WorldObject
from hric_core.geometry import MassProperties
from mujoco_ros_control.bushings import SceneBushings
from mujoco_ros_control.contact import MujocoPenaltyContact
from mujoco_ros_control.model_joints import MujocoModelJoints
from mujoco_ros_control.robot import MujocoConfig, MujocoRobot
from mujoco_ros_control.scene import CompiledScene
from mujoco_ros_control.scene_spec import SceneSpec, build


class MujocoWorld(Models[MujocoModelJoints]):
    """Robot and models around it in one scene, which is compiled again for each addition or removal.

    Args:
        itself: model of the robot.
        robot: robot in the scene.
        objects: objects of the world file.
        rules: configured surfaces of single links.
        masks: pairs of patterns of the robot's links that do not collide.
        config: parameters of the plant.

    Attributes:
        scene: present compiled scene.
        penalty: penalty contact.
        bushings: bushings between links.
        acts: True if the world applies any forces: drives of models, penalty contact or bushings.
    """

    bushings: SceneBushings
    _config: MujocoConfig

    def __init__(
        self,
        itself: Model,
        robot: MujocoRobot,
        objects: Sequence[WorldObject],
        rules: Surfaces,
        masks: Sequence[tuple[str, str]],
        config: MujocoConfig,
    ) -> None:
        super().__init__(itself.tree, objects, rules, config)
        self._itself, self._robot, self._masks = itself, robot, list(masks)
        self._loads: dict[str, MassProperties] = {}
        self.penalty = MujocoPenaltyContact(self.springs)
        self.bushings = SceneBushings(self.full_name, self.near)
        self._restore()
        self._compile()
        self._begin(self.models.values())

    def _admit(self, model: Model) -> None:
        super()._admit(model)
        self.joints[model.name] = MujocoModelJoints(model, self._config)

    def _compile(self) -> None:
        """Compile the scene with the present models and loads, in its start state."""
        losses = dict(zip(self._robot.names, self._robot.losses, strict=True))
        for joints in self.joints.values():
            losses |= zip(joints.names, joints.losses, strict=True)
        built = build(
            [self._itself, *self.models.values()],
            self._surfaces_of_links(),
            losses,
            self._loads,
            self._masks,
            self._config.time_step,
            self_collision=self._config.self_collision,
        )
        self._begin_scene(built)

    def _begin_scene(self, built: SceneSpec) -> None:
        """Compile a scene and use it from now on; if that raises a HricError, the previous scene stays."""
        self.scene = CompiledScene(built, self._config.time_step, self._config.gravity, self._config.integrator)

    def _begin(self, models: Collection[Model]) -> None:
        """Let robot, joints, contact and bushings use a new scene; set these models to their start states."""
        for model in models:
            if not model.fixed:
                self.scene.put_free(model.free_joint, model.linear, model.angular)
        self.penalty.bind(self.scene)
        self._robot.bind(self.scene)
        for joints in self.joints.values():
            joints.bind(self.scene)
        for model in models:
            self.joints[model.name].begin()
        self._acting = [joints for joints in self.joints.values() if joints.losses]
        self.bind_connected()

    def _build(self, begin: Sequence[Model] = ()) -> None:
        states = self.scene.states()
        self._compile()
        self.scene.put(states)
        self._begin(begin)

    def reset(self) -> None:
        """Reset the models to their start states by a new compilation; the robot's joints stay.

        The new compilation makes sure that nothing in the engine's memory affects the next run. A scene without a step
        since its compilation needs none.
        """
        self.wrenches.clear()
        states = self.scene.states()
        before = list(self.models)
        self._restore()
        if list(self.models) == before:
            if self._robot.stepped:
                self._begin_scene(self.scene.built)
            else:
                mujoco.mj_resetData(self.scene.m, self.scene.d)
        else:
            self._compile()
        prefix = f"{self._itself.name}::"
        self.scene.put({name: state for name, state in states.items() if name.startswith(prefix)})
        self._begin(self.models.values())
        for joints in self._acting:
            joints.reset()
        self.bushings.restart()

    def set_loads(self, loads: Mapping[str, MassProperties]) -> None:
        """Replace the payloads of the robot, by link, in the link's frame."""
        before = self._loads
        self._loads = {f"{self._itself.name}::{link}": load for link, load in loads.items()}
        try:
            self._build()
        except BaseException:
            self._loads = before
            raise

    # -- joints of models, and bushings between links ------------------------------------------------------------------

    def forget_contacts(self) -> None:
        """Clear contacts and the state of contact springs, after bodies were repositioned."""
        self.penalty.forget()

    def act(self) -> None:
        """Apply drives and stops of models, penalty contact and bushings in the coming step, from the present state."""
        for joints in self._acting:
            joints.act()
        if self.penalty.any:
            self.penalty.push()
        if self.bushings.any:
            self.bushings.push()

    def bind_connected(self) -> None:
        """Find the links of the bushings again, after bushings were added or removed."""
        self.bushings.bind(self.scene)
        self.acts = bool(self._acting) or self.penalty.any or self.bushings.any
