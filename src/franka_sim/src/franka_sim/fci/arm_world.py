"""World of one or several emulated arms: a physics plant, everything that acts in it, and the control boxes."""

from collections.abc import Callable, Sequence

from franka_sim.box.requests import MotionCommand
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.complaints import LOG
from hric_control.plant import Plant
from hric_control.sim.participants import Participants
from hric_control.sim.shared_plant import SharedPlant
from hric_core.errors import HricError


class ArmWorld:
    """World of emulated arms, advanced one millisecond at a time.

    Args:
        plant: physics engine with the joints of all arms, in their order.
        participants: others that act in the plant, e.g. an emulated human.
        arms: the arms.
        shared: plant as divided among several arms; None: there is one arm, which has the whole plant.

    Attributes:
        plant, participants, arms: as in Args.
        on_cycle: callback at the end of each cycle with the robot time [s], before the states are sent.
    """

    def __init__(
        self, plant: Plant, participants: Participants, arms: Sequence[ArmDevice], shared: SharedPlant | None = None
    ) -> None:
        self.plant, self.participants, self.arms = plant, participants, tuple(arms)
        self.on_cycle: Callable[[float], None] | None = None
        self._shared = shared
        self._period, self._cycles, self._time = plant.time_step, 0, 0.0
        for arm in arms:
            arm.world = self
        self.reset()

    def reset(self) -> None:
        """Reset all arms to their start poses at rest, and the world to its initial state; robot time continues."""
        self._reset_plant()
        for arm in self.arms:
            arm.box.reset(arm.q_start)
        self._read()

    def _reset_plant(self) -> None:
        self.plant.reset([position for arm in self.arms for position in arm.q_start])
        self.participants.reset()

    def cycle(self, commands: Sequence[MotionCommand | None]) -> None:
        """Apply the torques of all arms, step the plant once, and update all control boxes.

        If the plant becomes unstable (it diverges, or gets an effort beyond the engine's limits), each motion ends in a
        reflex that its client can read, and the arms return to their start poses: the server continues.

        Args:
            commands: command of each arm; None: no packet came.
        """
        try:
            for arm, command in zip(self.arms, commands, strict=True):
                arm.plant.apply(arm.box.write(command))
            if self._shared is not None:
                self.plant.apply(self._shared.command)
            self.participants.step(self._time)
        except HricError as error:
            LOG.error("each simulated arm is reset to its start pose after an error of the physics: %s", error)
            self._reset_plant()
            for arm in self.arms:
                arm.box.break_down(arm.q_start)
        self._cycles += 1
        self._time = self._cycles * self._period
        self._read()
        if self.on_cycle is not None:
            self.on_cycle(self._time)

    def _read(self) -> None:
        if self._shared is not None:
            self._shared.read()
        for arm in self.arms:
            arm.read(self._time)

    def close(self) -> None:
        """Release the plant and all that act in it."""
        self.participants.close()
        self.plant.close()
