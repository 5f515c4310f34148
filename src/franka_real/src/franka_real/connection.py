"""From an address to an arm: probe, watchdog, libfranka; and what is learnt from the first state."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.robot_state import RobotState
from franka_real import probe
from franka_real.backend import Backend, ConnectionLostError, ControlSettings
from franka_real.realtime_setup import priority_kept
from franka_real.settings import Settings, missing_wheel
from franka_real.watchdog import Watchdog
from hric_control.errors import CommandError

MASS_TOLERANCE = 0.1
"""How far the end effector's mass in the description and in the arm may be apart without a word; our choice [kg]."""


@dataclass
class Connection:
    """An arm and who watches over it.

    Attributes:
        arm: libfranka.
        watchdog: None where it is switched off.
    """

    arm: Backend
    watchdog: Watchdog | None

    def patience(self) -> AbstractContextManager[None]:
        """`with connection.patience():` around a call that may take long."""
        return nullcontext() if self.watchdog is None else self.watchdog.patiently()

    def close(self) -> None:
        """End the connection."""
        with self.patience():
            self.arm.close()
        if self.watchdog is not None:
            self.watchdog.close()


def open_connection(settings: Settings) -> Connection:
    """Connect.

    Raises:
        HricError: nobody is there, the arm refuses, or its binding is missing.
    """
    probe.check(settings.robot_ip, settings.probe_timeout)
    make = _binding(settings.robot)
    watchdog = None
    if settings.watchdog_timeout > 0.0:
        watchdog = Watchdog(settings.watchdog_timeout, settings.watchdog_patience, f"the {settings.robot} at {settings.robot_ip}")
    try:
        with priority_kept(), nullcontext() if watchdog is None else watchdog.patiently(settings.connect_timeout):
            return Connection(make(settings.robot_ip, settings.control), watchdog)
    except BaseException as error:
        if watchdog is not None:
            watchdog.close()
        if isinstance(error, ConnectionLostError) and "TCP connection got interrupted" in str(error):
            raise ConnectionLostError(f"{error} Does another program control the arm?") from error
        raise


def _binding(robot: str) -> Callable[[str, ControlSettings], Backend]:
    try:
        if robot == "fr3":
            from franka_real.fr3 import Fr3Backend

            return Fr3Backend
        from franka_real.panda import PandaBackend

        return PandaBackend
    except ImportError as error:
        raise missing_wheel(error, robot) from error


def learn(model: KdlFrankaModel, state: RobotState) -> list[str]:
    """Give the model the load and the frames that the arm knows; answers what does not fit together."""
    problems = []
    try:
        model.set_load(state.m_load, state.F_x_Cload, state.I_load)
    except CommandError as error:
        problems.append(f"the load that the arm reckons with cannot be used: {error}")
    model.set_ee(np.array(state.F_T_EE).reshape(4, 4).T)
    model.set_stiffness_frame(np.array(state.EE_T_K).reshape(4, 4).T)
    described = model.ee_inertial.mass
    if abs(described - state.m_ee) > MASS_TOLERANCE:
        problems.append(f"robot_description has {described:.2f} kg at the flange, the arm reckons with an end effector of {state.m_ee:.2f} kg (Desk)")
    return problems


def models(settings: Settings, arm: Backend, kdl: KdlFrankaModel, description: str) -> list[FrankaModel]:
    """The model that controllers get, and, where it is not KDL's, that one too."""
    if settings.model == "kdl":
        return [kdl]
    from franka_real.libfranka_model import LibfrankaModel

    if settings.robot == "fr3":
        return [LibfrankaModel.for_fr3(arm.load_model(), arm.read_once(), description, settings.arm_id), kdl]
    # libfranka for the Panda does not tell how the base is mounted; the description does.
    return [LibfrankaModel.for_panda(arm.load_model(), arm.read_once(), kdl.gravity_base.tolist()), kdl]
