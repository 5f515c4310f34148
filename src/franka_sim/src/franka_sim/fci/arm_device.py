"""The emulated arm behind the server: a plant and the control box, made of the command's arguments."""

import argparse
from collections.abc import Callable, Sequence
from typing import Any

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim import sensors
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import BoxConfig
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import MotionCommand, MoveRequest, Outcome
from franka_sim.fci.complaints import LOG
from franka_sim.fci.hand_service import Hand
from franka_sim.fci.robots import Robot
from franka_sim.fci.wire import StateCodec
from franka_sim.gripper import Gripper
from franka_sim.model_library import library_for
from franka_sim.realism import parse
from hric_control import plugins
from hric_control.errors import CommandError, HricError
from hric_control.plant import Plant

MAX_LOAD, MAX_LOAD_DISTANCE, MAX_LOAD_INERTIA = 20.0, 1.0, 20.0
"""Of a payload that a client sets [kg], [m from the flange], [kg m^2]: project default, unconfirmed, far beyond the 3
kg that the arm carries."""


class ArmDevice:
    """Plant and control box, one millisecond at a time.

    Args:
        plant: the physics.
        box: the control box.
        urdf: makes the arm's description as clients get it.
        model_library: the compiled model of protocol 5.
        q: pose of the start and of `reset`, 7 floats [rad].
        hand: at the flange, or None.
        read_state: how the sensors report the plant; None: as it is.

    Attributes:
        state: of the box.
        plant, box, hand: as given.
    """

    def __init__(
        self,
        plant: Plant,
        box: ControlBox,
        urdf: Callable[[], str],
        model_library: bytes,
        q: Sequence[float],
        hand: Hand | None = None,
        read_state: sensors.ReadState | None = None,
    ) -> None:
        self.plant, self.box, self.hand, self.state = plant, box, hand, box.state
        self._read_state = read_state or plant.read_state
        self._codec: StateCodec | None = None
        self.urdf, self.model_library = urdf, model_library
        self._q_start = list(q)
        self._q, self._dq, self._tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
        self._period, self._cycles = plant.time_step, 0
        # Requests of clients go to the box as they are.
        self.move: Callable[[MoveRequest], Outcome] = box.move
        self.stop_move, self.recover, self.take_finished = box.stop_move, box.recover, box.take_finished
        self.connection_lost = box.connection_lost
        self.set_user_stop, self.set_guiding = box.set_user_stop, box.set_guiding
        self.set_collision_behavior = box.set_collision_behavior
        self.set_joint_impedance, self.set_cartesian_impedance = box.set_joint_impedance, box.set_cartesian_impedance
        self.set_guiding_mode, self.set_filters = box.set_guiding_mode, box.set_filters
        self.set_EE_T_K, self.set_NE_T_EE = box.set_EE_T_K, box.set_NE_T_EE
        self.reset()

    def reset(self) -> None:
        """The arm at its start pose at rest, the world as at the start; time goes on."""
        self.plant.reset(self._q_start)
        self.box.reset(self._q_start)
        self._read()

    def cycle(self, command: MotionCommand | None) -> None:
        """The torque for the command, one step of the plant, and what the box makes of the arm then.

        Where the plant breaks down (diverges, or an effort no engine can stand), the motion ends in a reflex whose
        name the client gets, and the arm is put back to its start: a server goes on.
        """
        self._cycles += 1
        try:
            self.plant.apply(self.box.write(command))
            self.plant.step()
        except HricError as error:
            LOG.error("%s; the arm is put back to its start", error)
            self.plant.reset(self._q_start)
            self.box.break_down(self._q_start)
        self._read()

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> Outcome:
        """Payload of the box, within bounds that keep its torques finite."""
        if mass > MAX_LOAD or max(map(abs, com)) > MAX_LOAD_DISTANCE or max(map(abs, inertia)) > MAX_LOAD_INERTIA:
            bounds = f"{MAX_LOAD:g} kg, {MAX_LOAD_DISTANCE:g} m, {MAX_LOAD_INERTIA:g} kg m^2"
            raise CommandError(
                f"a load of {mass:g} kg at {list(com)} m with inertia {list(inertia)} kg m^2 is beyond {bounds}"
            )
        return self.box.set_load(mass, com, inertia)

    def _read(self) -> None:
        self._read_state(self._q, self._dq, self._tau)
        self.box.read(self._q, self._dq, self._tau, self._cycles * self._period)

    def encode(self, codec: StateCodec, message_id: int) -> bytes:
        """The state as a datagram."""
        if codec is not self._codec:
            self._codec, self._pack = codec, self.state.fields.packer(codec.names, codec.real)
        return codec.join(message_id, self._pack(self.state), self.state)

    def push(self, link: str, force: Sequence[float], duration: float) -> None:
        """Act on a link's origin: force in the world frame [N], for a time [s]."""
        self.plant.apply_wrench(link, force, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), duration)

    def close(self) -> None:
        """Release the plant."""
        self.plant.close()


def make_arm(options: argparse.Namespace, robot: Robot) -> ArmDevice:
    """Plant, box and hand. Raises HricError."""
    arm_id = robot.arm_id
    urdf_xml = robot.urdf(not options.no_hand, not options.no_collision)
    realism = parse(options.realism, "--realism")
    given = {name: getattr(options, name) for name in ("world", "gui", "friction") if getattr(options, name)}
    plant_config: dict[str, Any] = {"rotor_inertia": options.rotor_inertia, **given}
    if options.no_collision:
        plant_config |= {"collision": False, "self_collision": False}
    plant_config = realism.with_friction(plant_config, arm_id)
    model = KdlFrankaModel(urdf_xml, arm_id)
    config = BoxConfig(
        limits=robot.limits(),
        friction=realism.known_friction(plant_config, model.joint_names),
        rotor_inertia=(options.rotor_inertia,) * 7,
        reflexes=not options.no_reflexes,
        max_lost_packets=options.max_lost_packets or None,
    )
    compiled = CompiledArm(urdf_xml, arm_id, config.min_singular_value)
    box = ControlBox(model, compiled, config, lambda text: LOG.warning("%s", text))
    plant = plugins.find(plugins.PLANT, options.plant)(realism.body(urdf_xml, arm_id), model.joint_names, plant_config)
    hand = None if options.no_hand else Gripper()
    read_state = sensors.attach(plant, box, realism, options.seed)
    return ArmDevice(plant, box, robot.served_urdf, library_for(urdf_xml, arm_id), options.q_start, hand, read_state)
