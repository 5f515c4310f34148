"""Hardware interfaces: typed access to the state and the commands of joints.

A `RobotHW` owns the storage (`JointStates`, `JointCommands`: plain Python floats, which for seven joints are twice as
fast as arrays) and registers interfaces on it. A controller gets a group of joints, or one joint, from an interface;
both are views of the same storage. Getting a handle from a command interface claims the joint; the manager collects the
claims and refuses conflicts.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar, Self, TypeVar

import numpy as np
import numpy.typing as npt

from hric_core.errors import CommandError, HricError, UnknownNameError, check_known

FloatArray = npt.NDArray[np.float64]


def _unique_names(names: Iterable[str]) -> tuple[str, ...]:
    result = tuple(names)
    if not result or any(not isinstance(name, str) or not name for name in result):
        raise HricError(f"joint names must be non-empty strings, at least one; got {list(result)}")
    if len(set(result)) != len(result):
        raise HricError(f"joint names must differ; got {list(result)}")
    return result


class JointStates:
    """State of n joints at the measuring instant, owned by a RobotHW, which writes the lists in place.

    Attributes:
        position: joint position, n floats [rad or m].
        velocity: joint velocity, n floats [rad/s or m/s].
        effort: measured joint effort, n floats [N m or N].
    """

    __slots__ = ("effort", "index", "names", "position", "velocity")

    def __init__(self, names: Iterable[str]) -> None:
        self.names = _unique_names(names)
        self.index = {name: i for i, name in enumerate(self.names)}
        self.position = [0.0] * len(self.names)
        self.velocity = [0.0] * len(self.names)
        self.effort = [0.0] * len(self.names)


class JointCommands:
    """Commands of n joints in the unit of their interface, in the order of `states`.

    Attributes:
        states: states of the same joints.
        value: n commands, written in place by controllers between the robot's `read` and `write`.
    """

    __slots__ = ("states", "value")

    def __init__(self, states: JointStates) -> None:
        self.states = states
        self.value = [0.0] * len(states.names)


class JointStateHandle:
    """Handle for reading the state of one joint."""

    __slots__ = ("_i", "_states", "name")

    def __init__(self, states: JointStates, name: str) -> None:
        check_known("joint", [name], states.names)
        self._states, self._i, self.name = states, states.index[name], name

    @property
    def position(self) -> float:
        """Joint position [rad or m]."""
        return self._states.position[self._i]

    @property
    def velocity(self) -> float:
        """Joint velocity [rad/s or m/s]."""
        return self._states.velocity[self._i]

    @property
    def effort(self) -> float:
        """Measured joint effort [N m or N]."""
        return self._states.effort[self._i]


class JointHandle(JointStateHandle):
    """Handle for reading the state and writing the command of one joint."""

    __slots__ = ("_commands",)

    def __init__(self, commands: JointCommands, name: str) -> None:
        super().__init__(commands.states, name)
        self._commands = commands

    @property
    def command(self) -> float:
        """Command of the joint, in the unit of its interface."""
        return self._commands.value[self._i]

    @command.setter
    def command(self, value: float) -> None:
        if not math.isfinite(value):
            raise CommandError(f"command of {self.name} is not finite: {value}")
        self._commands.value[self._i] = float(value)


class JointStateGroup:
    """Read-only states of several joints, in the requested order.

    The array properties build a new array at each access, so they should be read once per cycle."""

    __slots__ = ("_all_in_order", "_indices", "_states", "names")

    def __init__(self, states: JointStates, names: Iterable[str]) -> None:
        self.names = _unique_names(names)
        check_known("joint", self.names, states.names)
        self._states = states
        self._indices = [states.index[name] for name in self.names]
        self._all_in_order = self.names == states.names

    def __len__(self) -> int:
        return len(self.names)

    def _take(self, values: list[float]) -> list[float]:
        return values[:] if self._all_in_order else [values[i] for i in self._indices]

    @property
    def position(self) -> FloatArray:
        """Joint position, shape (n,) [rad or m]."""
        return np.array(self._take(self._states.position))

    @property
    def velocity(self) -> FloatArray:
        """Joint velocity, shape (n,) [rad/s or m/s]."""
        return np.array(self._take(self._states.velocity))

    @property
    def effort(self) -> FloatArray:
        """Measured joint effort, shape (n,) [N m or N]."""
        return np.array(self._take(self._states.effort))

    def positions(self) -> list[float]:
        """Return the joint position as n plain floats [rad or m], for control laws that save microseconds."""
        return self._states.position[:] if self._all_in_order else self._take(self._states.position)

    def velocities(self) -> list[float]:
        """Return the joint velocity as n plain floats [rad/s or m/s]."""
        return self._states.velocity[:] if self._all_in_order else self._take(self._states.velocity)

    def efforts(self) -> list[float]:
        """Return the measured joint effort as n plain floats [N m or N]."""
        return self._take(self._states.effort)


class JointGroup(JointStateGroup):
    """Handle for reading the states and writing the commands of several joints, in the requested order."""

    __slots__ = ("_commands",)

    def __init__(self, commands: JointCommands, names: Iterable[str]) -> None:
        super().__init__(commands.states, names)
        self._commands = commands

    @property
    def command(self) -> FloatArray:
        """Current commands, shape (n,), in the unit of the interface."""
        return np.array(self._take(self._commands.value))

    @command.setter
    def command(self, values: Sequence[float] | FloatArray) -> None:
        self.set_command(values.tolist() if isinstance(values, np.ndarray) else values)

    def commands(self) -> list[float]:
        """Return the current commands as n plain floats, in the unit of the interface."""
        return self._take(self._commands.value)

    def set_command(self, values: Sequence[float]) -> None:
        """Set the commands of all joints of the group, or none if one is invalid.

        Args:
            values: n finite numbers in the order of `names`, in the unit of the interface.

        Raises:
            CommandError: wrong length or a value that is not finite; the previous commands stay in force.
        """
        # The sum is finite if every value is: one test usually suffices; the bad value is searched only on failure.
        if len(values) != len(self.names) or not math.isfinite(sum(values)):
            self._refuse(values)
        if self._all_in_order:
            self._commands.value[:] = values
        else:
            target = self._commands.value
            for i, value in zip(self._indices, values, strict=True):
                target[i] = value

    def _refuse(self, values: Sequence[float]) -> None:
        if len(values) != len(self.names):
            raise CommandError(
                f"command has {len(values)} values for {len(self.names)} joints ({', '.join(self.names)})"
            )
        bad = [f"{name}={value}" for name, value in zip(self.names, values, strict=True) if not math.isfinite(value)]
        raise CommandError(f"command is not finite: {', '.join(bad) or 'the sum overflows'}")


class HardwareInterface:
    """Base class of all interfaces: named resources (joints), and those claimed since `clear_claims`.

    Attributes:
        cpp_name: name of the interface in ros_control's messages and transmissions.
        claims_resources: True if getting a handle claims its resources for one controller exclusively.
    """

    cpp_name: ClassVar[str] = ""
    claims_resources: ClassVar[bool] = False

    def __init__(self) -> None:
        self._claims: set[str] = set()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the resources, e.g. joints, that the interface offers."""
        raise NotImplementedError(f"{type(self).__name__} does not declare its resources")

    @property
    def claims(self) -> frozenset[str]:
        """Names of the resources, e.g. joints, that were claimed since `clear_claims`."""
        return frozenset(self._claims)

    def joined(self, others: Sequence[Self]) -> Self | None:
        """Return one interface with the resources of this one and of others of its type, for several robots in one.

        None, the default: interfaces of this type cannot be joined.
        """
        return None

    def clear_claims(self) -> None:
        """Clear the claims; the manager calls this before each controller's `init`."""
        self._claims.clear()

    def _claim(self, names: Iterable[str]) -> None:
        if self.claims_resources:
            self._claims.update(names)

    def _check(self, names: Iterable[str]) -> None:
        check_known("joint", names, self.names, type(self).__name__)


class JointStateInterface(HardwareInterface):
    """Interface to read-only joint states; claims nothing."""

    cpp_name = "hardware_interface::JointStateInterface"

    def __init__(self, states: JointStates) -> None:
        super().__init__()
        self.states = states

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.states.names

    def handle(self, name: str) -> JointStateHandle:
        """Return the state of one joint."""
        self._check([name])
        return JointStateHandle(self.states, name)

    def group(self, names: Iterable[str] | None = None) -> JointStateGroup:
        """Return the states of the named joints, in that order; of all joints by default."""
        requested = _unique_names(self.names if names is None else names)
        self._check(requested)
        return JointStateGroup(self.states, requested)


class JointCommandInterface(HardwareInterface):
    """Interface to joint states and commands; a handle claims its joints."""

    claims_resources = True

    def __init__(self, commands: JointCommands, names: Iterable[str] | None = None) -> None:
        super().__init__()
        self.commands = commands
        self._names = commands.states.names if names is None else _unique_names(names)
        check_known("joint", self._names, commands.states.names, type(self).__name__)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints that offer this command."""
        return self._names

    def handle(self, name: str) -> JointHandle:
        """Return state and command of one joint, and claim it."""
        self._check([name])
        self._claim([name])
        return JointHandle(self.commands, name)

    def group(self, names: Iterable[str] | None = None) -> JointGroup:
        """Return states and commands of the named joints, in that order (of all joints by default), and claim them."""
        requested = _unique_names(self.names if names is None else names)
        self._check(requested)
        self._claim(requested)
        return JointGroup(self.commands, requested)


class EffortJointInterface(JointCommandInterface):
    """Interface whose commands are joint efforts [N m or N]."""

    cpp_name = "hardware_interface::EffortJointInterface"


class VelocityJointInterface(JointCommandInterface):
    """Interface whose commands are joint velocities [rad/s or m/s]."""

    cpp_name = "hardware_interface::VelocityJointInterface"


class PositionJointInterface(JointCommandInterface):
    """Interface whose commands are joint positions [rad or m]."""

    cpp_name = "hardware_interface::PositionJointInterface"


class ForceTorqueSensorHandle:
    """Handle for reading the wrench of a force-torque sensor.

    Args:
        name: name of the sensor.
        frame_id: frame in whose axes, and about whose origin, the wrench is given.
        wrench: function that returns the present wrench, 6 floats [N], [N m].
    """

    __slots__ = ("_wrench", "frame_id", "name")

    def __init__(self, name: str, frame_id: str, wrench: Callable[[], Sequence[float]]) -> None:
        self.name, self.frame_id, self._wrench = name, frame_id, wrench

    @property
    def force(self) -> list[float]:
        """Force, 3 floats [N]."""
        return list(self._wrench()[:3])

    @property
    def torque(self) -> list[float]:
        """Torque, 3 floats [N m]."""
        return list(self._wrench()[3:])


class ForceTorqueSensorInterface(HardwareInterface):
    """Interface to the wrenches of force-torque sensors; claims nothing."""

    cpp_name = "hardware_interface::ForceTorqueSensorInterface"

    def __init__(self, sensors: Iterable[ForceTorqueSensorHandle]) -> None:
        super().__init__()
        self._sensors = {sensor.name: sensor for sensor in sensors}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(self._sensors)

    def joined(self, others: Sequence[Self]) -> Self:
        """Return one interface with the sensors of several robots."""
        return type(self)(sensor for part in (self, *others) for sensor in part._sensors.values())

    def handle(self, name: str) -> ForceTorqueSensorHandle:
        """Return the handle of one sensor."""
        check_known("sensor", [name], self.names, type(self).__name__)
        return self._sensors[name]


InterfaceT = TypeVar("InterfaceT", bound=HardwareInterface)


class InterfaceManager:
    """Registry of hardware interfaces by type; a base class of RobotHW."""

    def __init__(self) -> None:
        self._interfaces: dict[type[HardwareInterface], HardwareInterface] = {}

    def register_interface(self, interface: HardwareInterface) -> None:
        """Register `interface` under its type; a second one of the same type is refused."""
        if type(interface) in self._interfaces:
            raise HricError(f"{type(interface).__name__} is registered already")
        self._interfaces[type(interface)] = interface

    def interfaces(self) -> tuple[HardwareInterface, ...]:
        """Return all registered interfaces, in order of registration."""
        return tuple(self._interfaces.values())

    def has(self, interface_type: type[HardwareInterface]) -> bool:
        """Return True if an interface of this type is registered."""
        return interface_type in self._interfaces

    def get(self, interface_type: type[InterfaceT]) -> InterfaceT:
        """Return the registered interface of this type.

        Raises:
            UnknownNameError: the robot does not offer this interface; the message lists those it offers.
        """
        interface = self._interfaces.get(interface_type)
        if not isinstance(interface, interface_type):
            offered = [kind.__name__ for kind in self._interfaces]
            raise UnknownNameError("hardware interface", interface_type.__name__, offered, type(self).__name__)
        return interface
