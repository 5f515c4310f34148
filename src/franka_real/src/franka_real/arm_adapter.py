"""Adapter from the real arm to the services of franka_control; the control loop executes their requests."""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.transforms import check_transform, from_column_major
from franka_real.connection import Connection
from franka_real.state import LibfrankaState
from hric_core.errors import HricError


@dataclass
class _Call:
    function: Callable[[], None]
    done: threading.Event = field(default_factory=threading.Event)
    error: BaseException | None = None


class LoopCalls:
    """Queue of calls from other threads that the control loop executes between two cycles.

    libfranka is used by one thread only. Without a running loop, and in its own thread, calls are executed at once.
    """

    def __init__(self) -> None:
        self._calls: deque[_Call] = deque()
        self._state = threading.RLock()
        self._thread: int | None = None

    def open(self) -> None:
        """Make the calling thread the loop's thread from now on."""
        with self._state:
            self._thread = threading.get_ident()

    def close(self) -> None:
        """End the loop; waiting calls fail."""
        with self._state:
            self._thread = None
            while self._calls:
                call = self._calls.popleft()
                call.error = HricError("the control loop has ended")
                call.done.set()

    def request(self, function: Callable[[], None]) -> None:
        """Execute a call in the loop and wait for it; its error is raised here."""
        with self._state:
            if self._thread is None or self._thread == threading.get_ident():
                function()
                return
            call = _Call(function)
            self._calls.append(call)
        call.done.wait()
        if call.error is not None:
            raise call.error

    def serve(self) -> None:
        """Execute the waiting calls; called by the loop."""
        while self._calls:
            call = self._calls.popleft()
            try:
                call.function()
            except Exception as error:  # raised in the requesting thread
                call.error = error
            call.done.set()


class ArmAdapter:
    """Adapter that passes the requests of `ArmServices` to libfranka and to the models.

    Args:
        connection: connection to the arm.
        calls: queue of calls into the control loop.
        state: the arm's state.
        models: models that get the same payload and frames.
        on_recover: callback in the loop that ends the error state.
    """

    def __init__(
        self,
        connection: Connection,
        calls: LoopCalls,
        state: LibfrankaState,
        models: Sequence[FrankaModel],
        on_recover: Callable[[], None],
    ) -> None:
        self._arm, self._patience, self._calls = connection.arm, connection.patience, calls
        self._state, self._models, self.recover = state, models, on_recover

    def request(self, function: Callable[[], None]) -> None:
        """Call `function` between two cycles and wait for it."""
        self._calls.request(function)

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> None:
        """Set the payload, in addition to the end effector."""
        with self._patience():
            self._arm.set_load(mass, list(com), list(inertia))
        for model in self._models:
            model.set_load(mass, com, inertia)

    def set_EE_frame(self, NE_T_EE: Sequence[float]) -> None:
        """Set the end effector in the nominal end-effector frame."""
        T = check_transform(NE_T_EE, "NE_T_EE")
        F_T_NE = from_column_major(self._state.F_T_NE)
        with self._patience():
            self._arm.set_EE_frame(list(NE_T_EE))
        self._state.set_NE_T_EE = list(NE_T_EE)
        for model in self._models:
            model.set_ee(F_T_NE @ T)

    def set_K_frame(self, EE_T_K: Sequence[float]) -> None:
        """Set the stiffness frame in the end-effector frame."""
        T = check_transform(EE_T_K, "EE_T_K")
        with self._patience():
            self._arm.set_K_frame(list(EE_T_K))
        for model in self._models:
            model.set_stiffness_frame(T)

    def set_joint_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal joint impedance."""
        with self._patience():
            self._arm.set_joint_impedance(list(stiffness))

    def set_cartesian_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal Cartesian impedance."""
        with self._patience():
            self._arm.set_cartesian_impedance(list(stiffness))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set the contact and collision thresholds."""
        with self._patience():
            self._arm.set_collision_behavior(thresholds)
