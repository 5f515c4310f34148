"""Emulated arm behind the network server: a physics plant with everything that acts in it, and the control box."""

from collections.abc import Callable, Sequence
from xml.etree import ElementTree

from franka_sim import sensors
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import MotionCommand, MoveRequest, RequestOutcome
from franka_sim.fci.complaints import LOG
from franka_sim.fci.hand_service import Tool
from franka_sim.fci.wire import StateCodec
from franka_sim.gripper import Gripper
from franka_sim.vacuum import PUMP, SuctionCup, VacuumGripper
from hric_control.plant import Plant
from hric_control.sim.participants import Participants
from hric_core.errors import CommandError, HricError

MAX_LOAD, MAX_LOAD_DISTANCE, MAX_LOAD_INERTIA = 20.0, 1.0, 20.0
"""Maximum payload that a client may set: mass [kg], distance from the flange [m], inertia [kg m^2].

Project defaults, unconfirmed; far above the arm's rated payload of 3 kg.
"""


class ArmDevice:
    """Arm that consists of a physics plant and a control box, advanced one millisecond at a time.

    Args:
        plant: physics engine.
        participants: others that act in the plant, e.g. an emulated human.
        box: control box.
        urdf: function that returns the arm's description for clients.
        model_library: compiled model of protocol 5.
        q: pose at the start and after `reset`, 7 floats [rad].
        hand: hand or vacuum gripper at the flange, or None.
        read_state: function that reads the plant's joint state with sensor noise; None: without noise.

    Attributes:
        state: robot state, as the control box sends it.
        plant, participants, box, hand: as in Args.
        on_cycle: callback at the end of each cycle with the robot time [s], before the state is sent.
    """

    def __init__(
        self,
        plant: Plant,
        participants: Participants,
        box: ControlBox,
        urdf: Callable[[], str],
        model_library: bytes,
        q: Sequence[float],
        hand: Tool | None = None,
        read_state: sensors.ReadState | None = None,
    ) -> None:
        self.plant, self.participants, self.box, self.state = plant, participants, box, box.state
        self.hand = hand
        self.on_cycle: Callable[[float], None] | None = None
        self._read_state = read_state or plant.read_state
        self._codec: StateCodec | None = None
        self.urdf, self.model_library = urdf, model_library
        self._q_start = list(q)
        self._q, self._dq, self._tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
        self._period, self._cycles, self._time = plant.time_step, 0, 0.0
        # Requests of clients go to the box unchanged.
        self.move: Callable[[MoveRequest], RequestOutcome] = box.move
        self.stop_move, self.recover, self.take_finished = box.stop_move, box.recover, box.take_finished
        self.connection_lost = box.connection_lost
        self.set_user_stop, self.set_guiding = box.set_user_stop, box.set_guiding
        self.set_collision_behavior = box.set_collision_behavior
        self.set_joint_impedance, self.set_cartesian_impedance = box.set_joint_impedance, box.set_cartesian_impedance
        self.set_guiding_mode, self.set_filters = box.set_guiding_mode, box.set_filters
        self.set_EE_T_K, self.set_NE_T_EE = box.set_EE_T_K, box.set_NE_T_EE
        self.reset()

    def reset(self) -> None:
        """Reset the arm to its start pose at rest, and the world to its initial state; robot time continues."""
        self._reset_plant()
        self.box.reset(self._q_start)
        self._read()

    def _reset_plant(self) -> None:
        self.plant.reset(self._q_start)
        self.participants.reset()

    def cycle(self, command: MotionCommand | None) -> None:
        """Apply the command's torques, step the plant, and update the box.

        If the plant becomes unstable (it diverges, or gets an effort beyond the engine's limits), the motion ends in a
        reflex that the client can read, and the arm returns to its start pose: the server continues.
        """
        try:
            self.plant.apply(self.box.write(command))
            self.participants.step(self._time)
        except HricError as error:
            LOG.error("the simulated arm is reset to its start pose after an error of the physics: %s", error)
            self._reset_plant()
            self.box.break_down(self._q_start)
        self._cycles += 1
        self._time = self._cycles * self._period
        self._read()
        if self.on_cycle is not None:
            self.on_cycle(self._time)

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> RequestOutcome:
        """Set the payload of the box, up to MAX_LOAD and the other bounds, which keep its torques finite.

        Args:
            mass: mass [kg].
            com: centre of mass in the flange frame, 3 floats [m].
            inertia: inertia about the centre of mass, 9 floats [kg m^2].
        """
        if mass > MAX_LOAD or max(map(abs, com)) > MAX_LOAD_DISTANCE or max(map(abs, inertia)) > MAX_LOAD_INERTIA:
            bounds = f"{MAX_LOAD:g} kg, {MAX_LOAD_DISTANCE:g} m, {MAX_LOAD_INERTIA:g} kg m^2"
            raise CommandError(
                f"a load of {mass:g} kg at {list(com)} m with inertia {list(inertia)} kg m^2 exceeds the maximum of "
                f"{bounds}"
            )
        return self.box.set_load(mass, com, inertia)

    def _read(self) -> None:
        self._read_state(self._q, self._dq, self._tau)
        self.box.read(self._q, self._dq, self._tau, self._time)

    def encode(self, codec: StateCodec, message_id: int) -> bytes:
        """Return the robot state as a datagram of the codec's protocol."""
        if codec is not self._codec:
            names = (*codec.names, *codec.accelerometers)
            self._codec, self._pack = codec, self.state.fields.packer(names, codec.real)
        return codec.join(message_id, self._pack(self.state), self.state)

    def push(self, link: str, force: Sequence[float], duration: float) -> None:
        """Apply a force in the world frame [N] to a link's origin for a duration [s]."""
        self.plant.apply_wrench(link, force, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), duration)

    def close(self) -> None:
        """Release the plant and all that act in it."""
        self.participants.close()
        self.plant.close()


def mounted_tool(urdf_xml: str, arm_id: str, plant: Plant) -> Tool | None:
    """Return the hand or vacuum gripper that the robot description has, or None. Raises ParameterError."""
    links = {link.get("name") for link in ElementTree.fromstring(urdf_xml).iterfind("link")}
    if f"{arm_id}_{PUMP}" in links:
        return VacuumGripper(SuctionCup(plant, arm_id))
    return Gripper() if f"{arm_id}_hand" in links else None
