"""Connection to a real arm through libfranka, with probe and watchdog, and models set up from the arm's first state."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.robot_state import RobotState
from franka_hw_interface.transforms import from_column_major
from franka_real import probe
from franka_real.backend import ArmLostError, Backend
from franka_real.settings import FrankaRealSettings
from franka_real.watchdog import Watchdog
from hric_core.errors import CommandError, FailureError
from hric_core.realtime_setup import priority_kept

MASS_TOLERANCE = 0.1
"""Difference of the end effector's mass between robot description and arm that is reported [kg].

Project default, unconfirmed.
"""


@dataclass
class ArmConnection:
    """Connection to an arm, with its watchdog.

    Attributes:
        arm: the arm, through libfranka.
        watchdog: watchdog of the control loop; None: switched off.
    """

    arm: Backend
    watchdog: Watchdog | None

    def patience(self) -> AbstractContextManager[None]:
        """Return a context in which the watchdog allows a call to take long: `with connection.patience():`."""
        return nullcontext() if self.watchdog is None else self.watchdog.patiently()

    def close(self) -> None:
        """End the connection."""
        with self.patience():
            self.arm.close()
        if self.watchdog is not None:
            self.watchdog.close()


def open_connection(settings: FrankaRealSettings) -> ArmConnection:
    """Probe the arm's address, start the watchdog and connect through libfranka.

    Raises:
        HricError: no arm responds, the arm refuses the connection, or libfranka's binding is not installed.
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
            "scripts/setup" + (" on Debian 12 only; valid on Debian 13: robot:=panda" if robot == "fr3" else "")
        ) from error


def learn(model: KdlFrankaModel, state: RobotState) -> list[str]:
    """Set payload and frames of the model to those of the arm's state; return texts about contradictions.

    Contradictions are an invalid payload, and an end-effector mass that differs from the robot description.
    """
    problems = []
    try:
        model.set_load(state.m_load, state.F_x_Cload, state.I_load)
    except CommandError as error:
        problems.append(f"the load configured in the arm is ignored: {error}")
    model.set_ee(from_column_major(state.F_T_EE))
    model.set_stiffness_frame(from_column_major(state.EE_T_K))
    described = model.ee_inertial.mass
    if abs(described - state.m_ee) > MASS_TOLERANCE:
        problems.append(
            f"end-effector mass: {described:.2f} kg in robot_description, but {state.m_ee:.2f} kg in the arm; set the "
            "arm's end effector in Desk, or correct the description"
        )
    return problems


def models(settings: FrankaRealSettings, arm: Backend, kdl: KdlFrankaModel, description: str) -> list[FrankaModel]:
    """Return the models of the arm to keep up to date; the first one is for controllers.

    Args:
        settings: parameters of the robot node; `model` selects libfranka's model or KDL's.
        arm: connected arm.
        kdl: KDL model of the robot description, which is always included.
        description: URDF of the robot.
    """
    if settings.model == "kdl":
        return [kdl]
    from franka_real.libfranka_model import LibfrankaModel

    if settings.robot == "fr3":
        return [LibfrankaModel.for_fr3(arm.load_model(), arm.read_once(), description, settings.arm_id), kdl]
    # The direction of gravity is missing in the Panda's state; the description has it.
    return [LibfrankaModel.for_panda(arm.load_model(), arm.read_once(), kdl.gravity_base.tolist()), kdl]
