"""Simulated Franka arm as a RobotHW: a physics plant of any engine, and the emulated control box."""

from collections.abc import Sequence

from franka_hw_interface.arm_parameters import read_limits
from franka_hw_interface.command_set import CommandSet
from franka_hw_interface.commanded_arm import CommandedArm
from franka_hw_interface.modes import HOLD, ArmMode, Kind
from franka_hw_interface.robot_state import RobotMode
from franka_sim import sensors, settings
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest, RequestOutcome
from franka_sim.box_adapter import BoxAdapter
from hric_control.limits import check_start
from hric_control.sim.simulated_robot import PlantInput, SimulatedRobot
from hric_core.errors import HricError
from hric_core.node import Node

_GENERATORS = {
    None: GeneratorMode.NONE,
    Kind.POSITION: GeneratorMode.JOINT_POSITION,
    Kind.VELOCITY: GeneratorMode.JOINT_VELOCITY,
    Kind.POSE: GeneratorMode.CARTESIAN_POSITION,
    Kind.TWIST: GeneratorMode.CARTESIAN_VELOCITY,
}


SAG = 1e-4
"""Distance of a joint from its desired position above which controllers that were started between two runs must restart
[rad]: the motion then begins elsewhere than they know (project default, above the noise of `realism: measured`)."""


def _move_request(mode: ArmMode) -> MoveRequest:
    """Return the request that starts a motion in a command mode, as libfranka's control loops send it.

    The controller is EXTERNAL if torques are commanded, otherwise the internal joint impedance; a motion generator can
    be combined with both.
    """
    controller = ControllerMode.EXTERNAL if mode.torque else ControllerMode.JOINT_IMPEDANCE
    return MoveRequest(controller, _GENERATORS[mode.generator])


class FrankaHWSim(SimulatedRobot, CommandedArm):
    """Simulated Franka arm: seven joints in a physics plant, commanded through the emulated control box.

    Modes, reflexes and recovery are those of the real arm (`env:=real`). The control box compensates gravity of the arm
    and of the configured load, and the friction that it knows. The physical payload belongs to the plant; if it differs
    from the configured load, the arm sags as the real one does.

    A switch to another kind of command works as on the real arm: the motion ends, the arm holds its position, the next
    motion starts in the following cycle.

    Parameters, services and actions: INTERFACE.md.

    Attributes, in addition to those of `SimulatedRobot` and `CommandedArm`:
        box: emulated control box.
        model: the box's model of the arm.
    """

    def plant_input(self, root_node: Node, robot_hw_node: Node) -> PlantInput:
        """Read what the arm needs of its plant: the description and the parameters, both with the chosen realism."""
        description = root_node.search_param("robot_description")
        parameters, realism = settings.read(robot_hw_node, settings.SimulatedArmSettings)
        arm_id = parameters.arm_id
        config = realism.with_friction(parameters.plant, arm_id)
        return PlantInput(realism.body(description, arm_id), settings.joint_names(arm_id), config)

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read the parameters, build plant, model and box, and put the arm at its start pose."""
        node = self._node = robot_hw_node
        self.description = root_node.search_param("robot_description")
        parameters, realism = settings.read(node, settings.SimulatedArmSettings)
        self.arm_id, self.q_start = parameters.arm_id, list(parameters.q_start)
        plant_config = realism.with_friction(parameters.plant, self.arm_id)
        self.model = settings.make_model(node, self.description, self.arm_id, plant_config)
        names = self.model.joint_names
        check_start(self.description, names, self.q_start, node.resolve("q_start"))
        limits = read_limits(self.description, root_node, node, self.arm_id, names)
        with self._new_plant(node, self.plant_input(root_node, node)):
            period, states = self.plant.time_step, self.states
            rotors = dict(zip(names, self.rotor_inertia, strict=True))
            config = parameters.box(plant_config, rotors, period, realism)
            compiled = CompiledArm(self.description, self.arm_id, config.min_singular_value)
            self.box = ControlBox(self.model, compiled, config, self._warn)
            self.robot_state = self.box.state
            self._realism = realism
            settings.set_internal_impedance(node, parameters.internal_impedance.stiffness, self.box.joint_impedance)
            self._commands = CommandSet(self.arm_id, states, self.robot_state, limits, period, parameters.rate_limits)
            self.mode, self._requested, self._restart = HOLD, HOLD, False
            self._register(self.model)
            self._put(self.q_start, self._reset_plant)
            adapter = BoxAdapter(self.loop, self.box, self.recover)
            self._serve(adapter, root_node)
            self._buttons = adapter.buttons(root_node)

    @property
    def _running(self) -> bool:
        return self.loop.running

    # -- the cycle -----------------------------------------------------------------------------------------------------

    def begin(self) -> bool:
        """Start the motion that a controller switch has requested; return True if running controllers must restart."""
        waiting = self.mode is HOLD and self._requested.commanded and not self.error and not self.halted
        return waiting and not self.box.recovering and self._begin()

    def read(self, time: float, period: float) -> None:
        """Read the plant's joint state with sensor noise, and pass it to the control box."""
        states = self.states
        self._read_state(states.position, states.velocity, states.effort)
        self.box.read(states.position, states.velocity, states.effort, time)

    def _begin(self) -> bool:
        """Start the requested motion; return True if running controllers have to restart."""
        state = self.robot_state
        sagged = max(abs(a - b) for a, b in zip(state.q, state.q_d, strict=True)) > SAG
        outcome = self.box.move(_move_request(self._requested))
        if outcome is not RequestOutcome.STARTED:
            self._fail(f"a motion by {self._requested} is refused: {outcome.value}")
            return False
        self.mode = self._requested
        self._commands.enter(self.mode)
        restart, self._restart = self._restart or (self._early and sagged), False
        return restart

    def write(self, time: float, period: float) -> None:
        """Pass the controllers' command, within the joint limits, to the control box, and its torques to the plant."""
        mode, box = self.mode, self.box
        if mode is HOLD:
            self.plant.apply(box.write(None))
            return
        command = self._commands.limited_command(mode)
        command.finished = self._requested is not mode or self.halted
        self.plant.apply(box.write(command))
        if self.robot_state.robot_mode is not RobotMode.MOVE:
            self._end()

    def _end(self) -> None:
        """Return to holding the position after a motion ended; enter the error state if it did not end as requested."""
        self.mode = HOLD
        self._commands.enter(HOLD)
        if self.box.take_finished() is not RequestOutcome.SUCCESS:
            names = ", ".join(sorted(self.robot_state.last_motion_errors)) or self.robot_state.robot_mode.name.lower()
            self._fail(f"the motion was aborted: {names}")

    def recover(self) -> None:
        """Run automatic error recovery, in the loop; the aborted motion starts again, and its controllers restart."""
        self._refuse_recovery_in_motion()
        outcome = self.box.recover()
        if outcome is not RequestOutcome.SUCCESS:
            raise HricError(
                f"recovery is refused: {outcome.value} (robot mode: {self.robot_state.robot_mode.name.lower()})"
            )
        self.error, self._restart = "", True

    def _reset_plant(self, q: Sequence[float]) -> None:
        """Reset the plant, and restart the noise of the sensors with the parameter `plant/seed`."""
        seed = self._node.param("plant/seed", 0)
        self._read_state = sensors.attach(self.plant, self.box, self._realism, seed)
        super()._reset_plant(q)

    def _settle(self, q: Sequence[float]) -> None:
        self.box.reset(list(q))
        self.box.take_finished()
        self.mode, self.error = HOLD, ""
        self._read_state(self.states.position, self.states.velocity, self.states.effort)
        self._commands.enter(HOLD)
        self._commands.check_start()

    def shutdown(self) -> None:
        """Unregister the services and close the plant."""
        self._services.unregister()
        self._buttons.unregister()
        super().shutdown()
