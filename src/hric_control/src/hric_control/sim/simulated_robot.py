"""Base class of simulated robots: a plant, the loop that steps it, and changes of the robot's pose."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from hric_control.hardware_interface import JointStates
from hric_control.plant import DEFAULT_PLANT, Plant
from hric_control.plants import rotor_inertia
from hric_control.robot_hw import OnCycle, RobotHW
from hric_control.sim.participants import Participants
from hric_control.sim.sim_loop import SimLoop
from hric_core import plugins
from hric_core.errors import CommandError, HricError
from hric_core.node import Node
from hric_core.urdf import read


@dataclass(frozen=True)
class PlantInput:
    """Description, joints and parameters with which a simulated robot constructs its plant.

    Attributes:
        urdf_xml: URDF for the plant, which may differ from the robot's description.
        joint_names: the actuated joints.
        config: parameters of the plant.
    """

    urdf_xml: str
    joint_names: Sequence[str]
    config: Mapping[str, object]


class SimulatedRobot(RobotHW):
    """Base class of robots that are simulated by a plant.

    A subclass initialises itself in a `with self._new_plant(...)` block, and implements `plant_input`, `write` and
    `_settle`.

    Attributes:
        description: URDF of the robot.
        q_start: joint positions after `reset`, n floats [rad or m].
        states: joint states at the measuring instant.
        plant: simulated physics of the robot and its surroundings.
        loop: simulation loop, which defines robot time.
        rotor_inertia: rotor inertia at the plant's joints, n floats [kg m^2].
        halted: True while the robot must hold its position because another one with the same controller is in an error
            state; types of robot that have no error state ignore it.
    """

    description: str
    q_start: Sequence[float]
    states: JointStates
    plant: Plant
    loop: SimLoop
    rotor_inertia: tuple[float, ...]
    halted: bool = False

    def plant_input(self, root_node: Node, robot_hw_node: Node) -> PlantInput:
        """Read what the robot needs of its plant from the parameters; may be called before `init`.

        The arguments are those of `init`.

        Raises:
            HricError: a parameter is invalid, or such a robot cannot share a plant.
        """
        raise HricError(f"a {type(self).__name__} cannot share a plant with other robots")

    @contextmanager
    def _new_plant(self, node: Node, needed: PlantInput) -> Iterator[None]:
        """Construct the plant selected by the parameter `plant_type`, its loop and the joint states; or share a plant.

        If the block raises an error, the plant is closed.

        Args:
            node: node with the robot's private parameters.
            needed: description, joints and parameters for the plant.
        """
        self.rotor_inertia = rotor_inertia(needed.config, needed.joint_names, read(needed.urdf_xml))
        with ExitStack() as held:
            if self.shared is None:
                make_plant = plugins.find(plugins.PLANT, node.param("plant_type", DEFAULT_PLANT))
                self.plant = make_plant(needed.urdf_xml, needed.joint_names, needed.config)
                held.callback(self.plant.close)
                self.loop = SimLoop(self.plant.time_step, node.param("real_time_factor", 1.0))
            else:
                self.plant = self.shared.part(needed.joint_names)  # whose owner has set the loop, too
            self._participants = Participants(self.plant, node)
            held.callback(self._participants.close)
            self.states = JointStates(needed.joint_names)
            node.set_param("plant/integrator", self.plant.integrator)  # for the record of the run
            yield
            self._held = held.pop_all()

    def read(self, time: float, period: float) -> None:
        """Read the joint states at the measuring instant from the plant."""
        states = self.states
        self.plant.read_state(states.position, states.velocity, states.effort)

    def begin(self) -> bool:
        """Prepare for the controllers of this cycle, after `read`; return True if running controllers must restart."""
        return False

    def run(self, on_cycle: OnCycle) -> None:
        """Run cycles: read, `on_cycle` (the controllers), write, step the plant.

        The result of `on_cycle` is ignored, as a simulated robot changes its command mode without a new run."""
        read, begin, write, step = self.read, self.begin, self.write, self._participants.step

        def cycle(time: float, period: float, reset_controllers: bool) -> bool:
            read(time, period)
            on_cycle(time, period, begin() or reset_controllers)
            write(time, period)
            step(time)
            return True

        self.loop.run(cycle)

    def stop(self) -> None:
        """Let `run` return after the present cycle. May be called from any thread or a signal handler."""
        self.loop.stop()

    def reset(self, q: Sequence[float] | None = None) -> None:
        """Set the joint positions to q (or `q_start`) at rest, reset the world, and restart the controllers.

        Called in the loop; robot time is not reset."""
        self._put(self.q_start if q is None else q, self._reset_plant)
        self.loop.restart_controllers()

    def set_configuration(self, q: Sequence[float]) -> None:
        """Set the joint positions to q at rest, without changing the world, and restart the controllers.

        Called in the loop."""
        self._put(q, self.plant.set_configuration)
        self.loop.restart_controllers()

    def _reset_plant(self, q: Sequence[float]) -> None:
        self.plant.reset(q)
        self._participants.reset()

    def _put(self, q: Sequence[float], put: Callable[[Sequence[float]], None]) -> None:
        names = self.states.names
        if len(q) != len(names) or not all(map(math.isfinite, q)):
            raise CommandError(f"a pose must be {len(names)} finite numbers, for {', '.join(names)}; got {list(q)}")
        put(q)
        self._settle(q)

    def _settle(self, q: Sequence[float]) -> None:
        """Read the state after the joints were set to q at rest, and set the commands that keep them there."""
        raise NotImplementedError(
            f"{type(self).__name__} must implement _settle, which keeps the joints where they were set"
        )

    def shutdown(self) -> None:
        """Release the plant and its participants."""
        self._held.close()
