"""Connection to an arm (probe, watchdog, libfranka), and set-up of the model from its first state."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.robot_state import RobotState
from franka_hw_interface.transforms import from_column_major
from franka_real import probe
from franka_real.backend import ArmLostError, Backend
from franka_real.realtime_setup import priority_kept
from franka_real.settings import FrankaRealSettings
from franka_real.watchdog import Watchdog
from hric_core.errors import CommandError, FailureError

MASS_TOLERANCE = 0.1
"""Maximum unreported mass difference of the end effector, description to arm [kg]; project default, unconfirmed."""


@dataclass
class ArmConnection:
    """Connection to an arm, with its watchdog.

    Attributes:
        arm: libfranka.
        watchdog: None if it is switched off.
    """

    arm: Backend
    watchdog: Watchdog | None

    def patience(self) -> AbstractContextManager[None]:
        """Return a context for a call that may take long: `with connection.patience():`."""
        return nullcontext() if self.watchdog is None else self.watchdog.patiently()

    def close(self) -> None:
        """End the connection."""
        with self.patience():
            self.arm.close()
        if self.watchdog is not None:
            self.watchdog.close()


def open_connection(settings: FrankaRealSettings) -> ArmConnection:
    """Connect to the arm.

    Raises:
        HricError: no arm responds, the arm refuses, or its binding is missing.
    """
    probe.wait(settings.robot_ip, settings.probe_timeout, settings.wait_for_arm)
    backend = _backend(settings.robot)
    watchdog = None
    if settings.watchdog_timeout > 0.0:
        watchdog = Watchdog(
            settings.watchdog_timeout, settings.watchdog_patience, f"the {settings.robot} at {settings.robot_ip}"
        )
    try:
        with priority_kept(), nullcontext() if watchdog is None else watchdog.patiently(settings.connect_timeout):
            return ArmConnection(backend(settings), watchdog)
    except BaseException as error:
        if watchdog is not None:
            watchdog.close()
        if isinstance(error, ArmLostError) and "TCP connection got interrupted" in str(error):
            raise ArmLostError(f"{error} Does another program control the arm?") from error
        raise


def _backend(robot: str) -> Callable[[FrankaRealSettings], Backend]:
    wheel = "pylibfranka" if robot == "fr3" else "panda-python"
    try:
        if robot == "fr3":
            from franka_real.fr3 import Fr3Backend

            return Fr3Backend
        from franka_real.panda import PandaBackend

        return PandaBackend
    except ImportError as error:
        raise FailureError(
            f"libfranka's binding for robot {robot!r} cannot be imported ({error}); {wheel} is installed by "
            "scripts/setup"
        ) from error


def learn(model: KdlFrankaModel, state: RobotState) -> list[str]:
    """Set the model's load and frames to those of the arm; return the contradictions found."""
    problems = []
    try:
        model.set_load(state.m_load, state.F_x_Cload, state.I_load)
    except CommandError as error:
        problems.append(f"the load that is set in the arm cannot be used: {error}")
    model.set_ee(from_column_major(state.F_T_EE))
    model.set_stiffness_frame(from_column_major(state.EE_T_K))
    described = model.ee_inertial.mass
    if abs(described - state.m_ee) > MASS_TOLERANCE:
        problems.append(
            f"robot_description has {described:.2f} kg at the flange, the end effector set in the arm has "
            f"{state.m_ee:.2f} kg (Desk)"
        )
    return problems


def models(settings: FrankaRealSettings, arm: Backend, kdl: KdlFrankaModel, description: str) -> list[FrankaModel]:
    """Return the model for controllers first; if that is libfranka's, then also KDL's."""
    if settings.model == "kdl":
        return [kdl]
    from franka_real.libfranka_model import LibfrankaModel

    if settings.robot == "fr3":
        return [LibfrankaModel.for_fr3(arm.load_model(), arm.read_once(), description, settings.arm_id), kdl]
    # The direction of gravity is missing in the Panda's state; the description has it.
    return [LibfrankaModel.for_panda(arm.load_model(), arm.read_once(), kdl.gravity_base.tolist()), kdl]
