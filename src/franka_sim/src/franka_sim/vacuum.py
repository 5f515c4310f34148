"""Emulated vacuum gripper: a pump that evacuates a suction cup, and the body that the cup holds in the plant."""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from franka_hw_interface.hand import HandMotion, HandOutcome
from hric_control.plant import Articulated, Bushing, Plant
from hric_core.errors import ParameterError
from hric_core.parameters import Settings, number, package_yaml

PUMP = "cobot_pump"
"""Name of the pump's link, without the prefix of the arm."""
PROFILES = range(4)
"""Numbers of libfranka's production setup profiles."""
_HELD = "vacuum"
_MBAR = 100.0
"""One millibar [Pa]."""


@dataclass(frozen=True)
class VacuumConfig(Settings):
    """Parameters of the emulated vacuum gripper, explained in config/vacuum.yaml."""

    max_vacuum: float = number(above=0.0, unit="mbar")
    control_range: float = number(above=0.0, unit="mbar")
    present: float = number(above=0.0, unit="mbar")
    present_hysteresis: float = number(minimum=0.0, unit="mbar")
    evacuation_time: float = number(above=0.0, unit="s")
    cup_diameter: float = number(above=0.0, unit="m")
    stiffness: float = number(above=0.0, unit="N/m")
    damping: float = number(minimum=0.0, unit="N s/m")
    lost: float = number(above=0.0, unit="m")
    mass: float = number(above=0.0, unit="kg")
    com: float = number(unit="m")
    inertia: float = number(above=0.0, unit="kg m^2")
    length: float = number(above=0.0, unit="m")
    radius: float = number(above=0.0, unit="m")


@cache
def defaults() -> VacuumConfig:
    """Return the default parameters of the emulated vacuum gripper, from config/vacuum.yaml."""
    return VacuumConfig.of(package_yaml(__file__, "vacuum"), "franka_sim/config/vacuum.yaml:")


def with_pump(urdf_xml: str, arm_id: str) -> str:
    """Return a robot description with the vacuum gripper at the flange.

    Args:
        urdf_xml: description of the arm without a hand.
        arm_id: prefix of the arm's link names.
    """
    root, c, link = ElementTree.fromstring(urdf_xml), defaults(), f"{arm_id}_{PUMP}"
    root.extend(
        ElementTree.fromstring(
            f"""<robot><link name="{link}">
            <inertial><origin xyz="0 0 {c.com}"/><mass value="{c.mass}"/>
            <inertia ixx="{c.inertia}" iyy="{c.inertia}" izz="{c.inertia}" ixy="0" ixz="0" iyz="0"/></inertial>
            <collision><origin xyz="0 0 {c.length / 2}"/>
            <geometry><cylinder radius="{c.radius}" length="{c.length}"/></geometry></collision></link>
            <joint name="{link}_joint" type="fixed"><parent link="{arm_id}_link8"/><child link="{link}"/></joint>
            </robot>"""
        )
    )
    return ElementTree.tostring(root, encoding="unicode")


class SuctionCup:
    """Suction cup at the end of the pump: holds the body that it touches in the plant.

    The held body hangs on a spring and damper. Beyond a force of vacuum times area it slips, and after a slip of
    `config.lost` it is lost.

    Args:
        plant: physics engine with the pump.
        arm_id: prefix of the pump's link.
        config: parameters; those of config/vacuum.yaml by default.

    Raises:
        ParameterError: the plant cannot connect bodies.
    """

    def __init__(self, plant: Plant, arm_id: str, config: VacuumConfig | None = None) -> None:
        config = config or defaults()
        if not isinstance(plant, Articulated):
            raise ParameterError(
                f"a vacuum gripper needs a plant that connects bodies (Articulated); {type(plant).__name__} cannot"
            )
        self._plant, self._link, self._config = plant, f"{arm_id}_{PUMP}", config
        self._body, self._force = "", 0.0
        self._T_link_cup = np.eye(4)
        self._T_link_cup[2, 3] = config.length

    @property
    def _holding(self) -> bool:
        return _HELD in self._plant.connections()

    def covered(self) -> bool:
        """Return True if a body seals the cup: it is held and not lost, or touches the pump."""
        if self._holding:
            return self._plant.bushing_load(_HELD).slipped < self._config.lost
        pairs = ((contact.body_a, contact.body_b) for contact in self._plant.contacts())
        touching = [pair for pair in pairs if any(name.endswith(f"::{self._link}") for name in pair)]
        self._body = next((name for pair in touching for name in pair if not name.endswith(f"::{self._link}")), "")
        return bool(self._body)

    def hold(self, vacuum: float) -> None:
        """Hold the body that covers the cup; `vacuum`: vacuum that determines the largest force [mbar]."""
        c, plant = self._config, self._plant
        force = vacuum * _MBAR * math.pi * c.cup_diameter**2 / 4.0
        if self._holding and force == self._force:
            return
        self.release()
        self._force = force
        T_world_cup = plant.link_state(self._link)[0] @ self._T_link_cup
        T_body_cup = np.linalg.inv(plant.link_state(self._body)[0]) @ T_world_cup
        plant.connect(
            _HELD,
            Bushing(
                *(self._link, self._body, self._T_link_cup, T_body_cup),
                *(c.stiffness, c.damping),
                force_limit=force,
                torque_limit=force * c.cup_diameter / 2.0,
            ),
        )

    def release(self) -> None:
        """Let go of the held body, if any."""
        if self._holding:
            self._plant.disconnect(_HELD)


class _Task(NamedTuple):
    motion: HandMotion
    left: float  # time until its time-out [s]
    suction: bool


class VacuumGripper:
    """Emulated vacuum gripper.

    Under a covered cup the vacuum rises evenly to its setpoint, otherwise it falls to zero. The pump has full power
    until the setpoint is reached. From then on, a body is held until the pump is off or the body is lost. Requests
    return at once with a `HandMotion`, which `step` executes; a new request aborts the running one. After a time-out
    of suction, and after `stop`, the pump is off (project default, unconfirmed).

    Args:
        cup: suction cup in the plant.
        config: parameters; those of config/vacuum.yaml by default.

    Attributes:
        vacuum: pressure below that of the room [mbar].
        in_control_range: True from the setpoint on, until the vacuum leaves the control range or the pump is off.
        part_present: True above the vacuum `config.present`, with hysteresis.
        part_detached: True from the loss or release of a part to the next suction.
    """

    def __init__(self, cup: SuctionCup, config: VacuumConfig | None = None) -> None:
        self._cup, self.config = cup, config or defaults()
        self.vacuum, self._setpoint = 0.0, 0.0
        self.in_control_range = self.part_present = self.part_detached = False
        self._task: _Task | None = None

    @property
    def power(self) -> int:
        """Present power of the pump [%]."""
        return 100 if self._setpoint and not self.in_control_range else 0

    def suck(self, setpoint: float, timeout: float, profile: int = 0) -> HandMotion:
        """Switch the pump on; success at the setpoint.

        Args:
            setpoint: vacuum [mbar]; the pump reaches `config.max_vacuum`.
            timeout: time after which the pump is switched off and the request is unsuccessful [s].
            profile: number of the production setup profile, 0 to 3; all are the same.
        """
        wrong = "" if setpoint > 0.0 else f"setpoint {setpoint:g} mbar; valid: above 0"
        if profile not in PROFILES:
            wrong = f"profile {profile}; valid: 0 to 3"
        motion = self._begin("vacuum", timeout, True, wrong)
        if motion.outcome is None:
            self._setpoint, self.part_detached = min(setpoint, self.config.max_vacuum), False
        return motion

    def drop_off(self, timeout: float) -> HandMotion:
        """Switch the pump off; success when no part is present, unsuccessful after `timeout` [s]."""
        motion = self._begin("drop off", timeout, False)
        if motion.outcome is None:
            self._setpoint = 0.0
        return motion

    def stop(self) -> HandMotion:
        """Abort the running request and switch the pump off."""
        motion = self._begin("stop", 0.0, False)
        self._task, self._setpoint = None, 0.0
        motion.end(HandOutcome.SUCCESS)
        return motion

    def step(self, dt: float) -> None:
        """Advance pump and request by dt [s]."""
        c, cup = self.config, self._cup
        aim = self._setpoint if self._setpoint and cup.covered() else 0.0
        change = c.max_vacuum / c.evacuation_time * dt
        self.vacuum = min(max(aim, self.vacuum - change), self.vacuum + change)
        lowest = self._setpoint - (c.control_range if self.in_control_range else 0.0)
        self.in_control_range = self._setpoint > 0.0 and self.vacuum >= lowest
        before = self.part_present
        self.part_present = self.vacuum > c.present - (c.present_hysteresis if before else 0.0)
        self.part_detached = self.part_detached or (before and not self.part_present)
        if not aim:
            cup.release()
        elif self.in_control_range:
            cup.hold(self._setpoint)
        if self._task is not None:
            self._judge(self._task, dt)

    def _begin(self, name: str, timeout: float, suction: bool, wrong: str = "") -> HandMotion:
        motion = HandMotion(name)
        if wrong or timeout < 0.0:
            motion.end(HandOutcome.FAIL, wrong or f"time-out {timeout:g} s; valid: not below 0")
            return motion
        if self._task is not None:
            self._task.motion.end(HandOutcome.ABORTED, f"ended by a new request: {name}")
        self._task = _Task(motion, timeout, suction)
        return motion

    def _judge(self, task: _Task, dt: float) -> None:
        done = self.in_control_range if task.suction else not self.part_present
        if not done and task.left - dt > 0.0:
            self._task = task._replace(left=task.left - dt)
            return
        self._task = None
        if done:
            task.motion.end(HandOutcome.SUCCESS)
            return
        if task.suction:
            self._setpoint = 0.0
        task.motion.end(HandOutcome.UNSUCCESSFUL, f"vacuum of {self.vacuum:.0f} mbar at the time-out")
