"""Emulated arm behind the network server: its joints in a physics plant, and its control box."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from franka_sim import sensors
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import MotionCommand, MoveRequest, RequestOutcome
from franka_sim.fci.hand_service import Tool
from franka_sim.fci.wire import StateCodec
from franka_sim.gripper import Gripper
from franka_sim.vacuum import PUMP, SuctionCup, VacuumGripper
from hric_control.plant import Plant

if TYPE_CHECKING:
    from franka_sim.fci.arm_world import ArmWorld


class ArmDevice:
    """Arm that consists of joints in a physics plant and a control box, in a world that advances it.

    Args:
        plant: physics engine, with the joints of this arm.
        box: control box.
        urdf: function that returns the arm's description for clients.
        model_library: compiled model of protocol 5.
        q: start pose, 7 floats [rad].
        hand: hand or vacuum gripper at the flange; None: there is none.
        read_state: function that reads the plant's joint state with sensor noise; None: without noise.

    Attributes:
        state: robot state, as the control box sends it.
        world: world of the arm, which sets this attribute.
        plant, box, hand: as in Args.
        q_start: pose at the start and after `reset`, 7 floats [rad].
    """

    world: "ArmWorld"

    def __init__(
        self,
        plant: Plant,
        box: ControlBox,
        urdf: Callable[[], str],
        model_library: bytes,
        q: Sequence[float],
        hand: Tool | None = None,
        read_state: sensors.ReadState | None = None,
    ) -> None:
        self.plant, self.box, self.state, self.hand = plant, box, box.state, hand
        self._read_state = read_state or plant.read_state
        self._codec: StateCodec | None = None
        self.urdf, self.model_library = urdf, model_library
        self.q_start = list(q)
        self._q, self._dq, self._tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
        # Requests of clients go to the box unchanged.
        self.move: Callable[[MoveRequest], RequestOutcome] = box.move
        self.stop_move, self.recover, self.take_finished = box.stop_move, box.recover, box.take_finished
        self.connection_lost = box.connection_lost
        self.set_user_stop, self.set_guiding = box.set_user_stop, box.set_guiding
        self.set_collision_behavior = box.set_collision_behavior
        self.set_joint_impedance, self.set_cartesian_impedance = box.set_joint_impedance, box.set_cartesian_impedance
        self.set_guiding_mode, self.set_filters = box.set_guiding_mode, box.set_filters
        self.set_EE_T_K, self.set_NE_T_EE = box.set_EE_T_K, box.set_NE_T_EE

    def reset(self) -> None:
        """Reset the world, with all arms in it."""
        self.world.reset()

    def cycle(self, *commands: MotionCommand | None) -> None:
        """Advance the world of the arm; commands: command of each arm in this world, None: no packet came."""
        self.world.cycle(commands)

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> RequestOutcome:
        """Set the payload of the box.

        Args:
            mass: mass [kg].
            com: centre of mass in the flange frame, 3 floats [m].
            inertia: inertia about the centre of mass, 9 floats [kg m^2].
        """
        return self.box.set_load(mass, com, inertia)

    def read(self, time: float) -> None:
        """Pass the joint state of the plant to the control box; called by the world. time: robot time [s]."""
        self._read_state(self._q, self._dq, self._tau)
        self.box.read(self._q, self._dq, self._tau, time)

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
        """Release the world of the arm, with all arms in it."""
        self.world.close()


def mounted_tool(urdf_xml: str, arm_id: str, plant: Plant) -> Tool | None:
    """Return the hand or vacuum gripper that the robot description has, or None. Raises ParameterError."""
    links = {link.get("name") for link in ElementTree.fromstring(urdf_xml).iterfind("link")}
    if f"{arm_id}_{PUMP}" in links:
        return VacuumGripper(SuctionCup(plant, arm_id))
    return Gripper() if f"{arm_id}_hand" in links else None
