"""What all simulated robots have in common: a plant, the loop that steps it, and how the robot is moved at once."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from hric_control.hardware_interface import JointStates
from hric_control.plant import Plant
from hric_control.plants import rotor_inertia
from hric_control.robot_hw import OnCycle, RobotHW
from hric_control.sim.participants import Participants
from hric_control.sim.sim_loop import SimLoop
from hric_core import plugins
from hric_core.errors import CommandError
from hric_core.node import Node

DEFAULT_PLANT = "pybullet_ros_control/PyBulletPlant"


class SimulatedRobot(RobotHW):
    """Base of the robots on a plant. A subclass builds itself within `_new_plant`, and implements `write` and
    `_settle`.

    Attributes:
        description: the URDF.
        q_start: where `reset` puts the robot, n floats [rad or m].
        states: joint states at the measuring instant.
        plant, loop: physics and clock.
        rotor_inertia: of the plant, n floats [kg m^2].
    """

    description: str
    q_start: Sequence[float]
    states: JointStates
    plant: Plant
    loop: SimLoop
    rotor_inertia: tuple[float, ...]

    @contextmanager
    def _new_plant(
        self, node: Node, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, Any]
    ) -> Iterator[None]:
        """The plant that the parameter `plant_type` names, its loop and states; a failure in the block closes it.

        Args:
            node: where the robot's private parameters are.
            urdf_xml: the body, which may differ from the description.
            joint_names: the actuated joints.
            config: parameters of the plant.
        """
        self.rotor_inertia = rotor_inertia(config, joint_names)
        make_plant = plugins.find(plugins.PLANT, node.param("plant_type", DEFAULT_PLANT))
        with ExitStack() as held:
            self.plant = make_plant(urdf_xml, joint_names, config)
            held.callback(self.plant.close)
            self._participants = Participants(self.plant, node)
            held.callback(self._participants.close)
            self.loop = SimLoop(self.plant.time_step, node.param("real_time_factor", 1.0))
            self.states = JointStates(joint_names)
            node.set_param("plant/integrator", self.plant.integrator)  # for the record of the run
            yield
            self._held = held.pop_all()

    def read(self, time: float, period: float) -> None:
        """State of the plant at the measuring instant."""
        states = self.states
        self.plant.read_state(states.position, states.velocity, states.effort)

    def run(self, on_cycle: OnCycle) -> None:
        """Read, controllers, write, step. A switch needs no other run, so what `on_cycle` returns does not matter."""
        read, write, step = self.read, self.write, self._participants.step

        def cycle(time: float, period: float, reset_controllers: bool) -> bool:
            read(time, period)
            on_cycle(time, period, reset_controllers)
            write(time, period)
            step(time)
            return True

        self.loop.run(cycle)

    def stop(self) -> None:
        """Let `run` return after this cycle; from any thread or a signal handler."""
        self.loop.stop()

    def reset(self, q: Sequence[float] | None = None) -> None:
        """Robot to q (or `q_start`) at rest, world to its start; time goes on, controllers restart. In the loop."""
        self._put(self.q_start if q is None else q, self._reset_plant)
        self.loop.restart_controllers()

    def set_configuration(self, q: Sequence[float]) -> None:
        """Robot to q at rest, the world left as it is, controllers restart. In the loop."""
        self._put(q, self.plant.set_configuration)
        self.loop.restart_controllers()

    def _reset_plant(self, q: Sequence[float]) -> None:
        self.plant.reset(q)
        self._participants.reset()

    def _put(self, q: Sequence[float], put: Callable[[Sequence[float]], None]) -> None:
        names = self.states.names
        if len(q) != len(names) or not all(map(math.isfinite, q)):
            raise CommandError(f"a pose is {len(names)} finite numbers for {', '.join(names)}; got {list(q)}")
        put(q)
        self._settle(q)

    def _settle(self, q: Sequence[float]) -> None:
        """The plant was put to q at rest: read its state, and begin with the commands that leave it there."""
        raise NotImplementedError(f"{type(self).__name__} has no _settle")

    def shutdown(self) -> None:
        """Release the plant, and who acts in it."""
        self._held.close()
