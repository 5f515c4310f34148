"""The simulated Franka arm as a RobotHW: any plant, and the emulated control box."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from franka_hw_interface.arm_services import ArmServices
from franka_hw_interface.command_set import CommandSet
from franka_hw_interface.commanded_arm import CommandedArm
from franka_hw_interface.modes import HOLD
from franka_hw_interface.robot_state import RobotMode
from franka_sim import sensors, settings
from franka_sim.box.compiled_arm import compiled_arm
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import Outcome
from franka_sim.move_requests import move_request
from franka_sim.told_box import ToldBox
from hric_control import plugins, realtime
from hric_control.errors import CommandError, HricError
from hric_control.hardware_interface import JointStates
from hric_control.node import Node
from hric_control.plant import Plant
from hric_control.robot_hw import OnCycle
from hric_control.sim_loop import SimLoop

DEFAULT_PLANT = "pybullet_ros_control/PyBulletPlant"


class FrankaHWSim(CommandedArm):
    """Seven joints on a plant behind the control box that `env:=real` finds behind the network, with the same modes, reflexes and recovery.

    The arm compensates gravity of itself and of the load it was TOLD, and friction as far as it knows it. The physical payload is the plant's;
    where it differs from what was told, the arm sags as the real one does.

    A switch to another kind of command takes the way it takes on the arm: the motion ends, the arm holds itself, the next motion begins in the
    following cycle.

    Parameters, services and actions: INTERFACE.md.

    Attributes, beside those of `CommandedArm`:
        description: the URDF.
        q_start: pose of the start and of `reset`, 7 floats [rad].
        plant, box, loop: physics, firmware and clock.
        model: what the arm knows of itself.
        rotor_inertia: of the plant, for controllers that check their gains, 7 floats [kg m^2].
    """

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read the parameters, build plant, model and box, put the arm at its start pose."""
        node = self._node = robot_hw_node
        self.description = root_node.search_param("robot_description")
        self.arm_id = settings.read_arm_id(node)
        realism = settings.read_realism(node)
        plant_config = settings.read_plant(node, self.arm_id, realism)
        self.model = settings.make_model(node, self.description, self.arm_id, plant_config)
        names = self.joint_names = self.model.joint_names
        self.q_start = settings.read_q_start(node, names)
        limits = settings.read_limits(self.description, root_node, node, self.arm_id, names)
        make_plant = plugins.find(plugins.PLANT, node.param("plant_type", DEFAULT_PLANT))
        self.plant: Plant = make_plant(realism.body(self.description, self.arm_id), names, plant_config)
        try:
            self.loop = SimLoop(self.plant.time_step, node.param("real_time_factor", 1.0))
            self.rotor_inertia = settings.read_rotor_inertia(plant_config, names)
            config = settings.read_box(node, plant_config, names, self.plant.time_step, realism)
            compiled = compiled_arm(self.description, self.arm_id, config.least_singular_value, node.log_info)
            self.box = ControlBox(self.model, config, self._hear, compiled)
            self._read_state = sensors.attach(self.plant, self.box, realism, plant_config.get("seed", 0))
            settings.read_internal_impedance(node, self.box.joint_impedance)
            self.states = JointStates(names)
            self.robot_state = self.box.state
            self._commands = CommandSet(self.arm_id, self.states, self.robot_state, limits, self.plant.time_step, settings.read_rate_limits(node))
            self.mode, self._wanted, self.error, self._restart = HOLD, HOLD, "", False
            self._register(self.model)
            self._place(self.q_start, self.plant.reset)
            self._services = ArmServices(ToldBox(self.loop, self.box, self.recover), root_node)
        except BaseException:
            self.plant.close()
            raise

    def _hear(self, text: str) -> None:
        """The box speaks, in the loop: a log line is written outside of it."""
        realtime.defer(self._node, lambda: self._node.log_warn(text), "log")

    @property
    def _running(self) -> bool:
        return self.loop.running

    # -- the cycle -----------------------------------------------------------------------------------------------------------------------

    def run(self, on_cycle: OnCycle) -> None:
        """Read, controllers, write, step; what `on_cycle` answers does not matter to an arm that changes its mode within the cycle."""

        def cycle(time: float, period: float, reset_controllers: bool) -> bool:
            self.read(time, period)
            if self._wanted.commanded and self.mode is HOLD and not self.error:
                reset_controllers = self._begin() or reset_controllers
            on_cycle(time, period, reset_controllers)
            self.write(time, period)
            self.plant.step()
            return True

        self.loop.run(cycle)

    def read(self, time: float, period: float) -> None:
        """State of the plant at the measuring instant as the sensors report it, and what the box makes of it."""
        states = self.states
        self._read_state(states.position, states.velocity, states.effort)
        self.box.read(states.position, states.velocity, states.effort, time)

    def _begin(self) -> bool:
        """The motion that the controllers want; whether controllers that run already have to restart."""
        outcome = self.box.move(move_request(self._wanted))
        if outcome is not Outcome.STARTED:
            self._fail(f"a motion by {self._wanted} is refused: {outcome.value}")
            return False
        self.mode = self._wanted
        self._commands.enter(self.mode)
        restart, self._restart = self._restart, False
        return restart

    def write(self, time: float, period: float) -> None:
        """The command of the mode within its limits to the box, its torques to the plant."""
        mode, box = self.mode, self.box
        if mode is HOLD:
            self.plant.apply(box.write(None))
            return
        command = self._commands.take(mode)
        command.finished = self._wanted != mode
        self.plant.apply(box.write(command))
        if self.robot_state.robot_mode is not RobotMode.MOVE:
            self._end()

    def _end(self) -> None:
        """The motion is over, asked for or not."""
        self.mode = HOLD
        self._commands.enter(HOLD)
        if self.box.take_finished() is not Outcome.SUCCESS:
            names = ", ".join(sorted(self.robot_state.last_motion_errors)) or self.robot_state.robot_mode.name.lower()
            self._fail(f"the motion was aborted: {names}")

    def recover(self) -> None:
        """Automatic error recovery, in the loop. The motion that was ended begins anew, and its controllers restart."""
        if self.mode.commanded:
            raise HricError("the arm is moving: there is nothing to recover from")
        outcome = self.box.recover()
        if outcome is not Outcome.SUCCESS:
            raise HricError(f"recovery is refused: {outcome.value} ({self.robot_state.robot_mode.name.lower()})")
        self.error, self._restart = "", True

    def stop(self) -> None:
        """Let `run` return after this cycle; from any thread or a signal handler."""
        self.loop.stop()

    # -- from outside, inside the loop ---------------------------------------------------------------------------------------------------

    def reset(self, q: Sequence[float] | None = None) -> None:
        """Robot to q (its start pose by default) at rest, errors cleared, the world to its start; run time goes on, controllers restart."""
        self._place(self.q_start if q is None else q, self.plant.reset)
        self.loop.restart_controllers()

    def set_configuration(self, q: Sequence[float]) -> None:
        """Robot to q at rest, errors cleared, the world left as it is, controllers restart. Inside the loop."""
        self._place(q, self.plant.set_configuration)
        self.loop.restart_controllers()

    def _place(self, q: Sequence[float], put: Callable[[Sequence[float]], None]) -> None:
        if len(q) != len(self.joint_names) or not all(map(math.isfinite, q)):
            raise CommandError(f"a pose is {len(self.joint_names)} finite numbers [rad]; got {list(q)}")
        put(q)
        self.box.reset(list(q))
        self.box.take_finished()
        self.mode, self.error = HOLD, ""
        self._read_state(self.states.position, self.states.velocity, self.states.effort)
        self._commands.enter(HOLD)
        self._commands.check_start()

    def shutdown(self) -> None:
        """Take the services back and close the plant."""
        self._services.unregister()
        self.plant.close()
