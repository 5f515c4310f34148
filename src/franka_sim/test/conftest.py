"""Fixtures and helpers for tests of the simulated arm without a ROS master."""

import functools
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import BoxConfig
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, RequestOutcome
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_control.hardware_interface import EffortJointInterface
from hric_control.robot_hw import ControllerInfo
from hric_core import plugins
from hric_core.local.node import LocalNode

# No shapes: these tests are about the arm, and cost half of the time without them.
PLANT = {"collision": False, "self_collision": False}


@functools.cache
def description(**arguments: Any) -> str:
    return panda_description.load(meshes=False, collision=False, **arguments)


def claim(
    interface: type = EffortJointInterface, name: str = "law", joints: int = 7, arm_id: str = "panda"
) -> ControllerInfo:
    """Return a controller that claims the first joints of the arm through an interface."""
    return ControllerInfo(
        name, "test/Law", {interface.cpp_name: frozenset(f"{arm_id}_joint{i}" for i in range(1, joints + 1))}
    )


class Arm:
    """A FrankaHWSim and its node; `run` drives it for a while with a law."""

    def __init__(self, urdf: dict[str, Any], plant: dict[str, Any], parameters: dict[str, Any]) -> None:
        given = {
            "robot_description": description(**urdf),
            "real_time_factor": 0.0,
            "plant": {**PLANT, **plant},
            **parameters,
        }
        self.node = LocalNode(given)
        self.hw = FrankaHWSim()
        self.hw.init(self.node, self.node)
        self._open = True

    def close(self) -> None:
        if self._open:
            self._open = False
            self.hw.shutdown()

    def run(self, duration: float, law: Callable[[float], None] | None = None) -> None:
        end = self.hw.loop.time + duration

        def on_cycle(time: float, period: float, reset_controllers: bool) -> bool:
            if law is not None:
                law(time)
            if time + 1.5 * period > end:
                self.hw.stop()
            return True

        self.hw.run(on_cycle)


@pytest.fixture
def make_arm() -> Iterator[Callable[..., Arm]]:
    """make_arm(hand=True, ..., plant={...}, parameters={...}) -> Arm; the other arguments are those of the
    description."""
    made: list[Arm] = []

    def make(plant: dict[str, Any] | None = None, parameters: dict[str, Any] | None = None, **urdf: Any) -> Arm:
        made.append(Arm(urdf, plant or {}, parameters or {}))
        return made[-1]

    yield make
    for arm in made:
        arm.close()


@pytest.fixture(name="claim")
def claim_fixture() -> Callable[..., ControllerInfo]:
    return claim


class BoxArm:
    """A control box on the real plant, without a hand's server or ROS; `cycle` is one millisecond in the order of the
    emulated robot.

    Attributes:
        box, state, plant: the parts.
        reports: lines that the box said.
    """

    def __init__(self, plant: dict[str, Any], config: dict[str, Any], q: list[float], urdf: dict[str, Any]) -> None:
        text = description(**urdf)
        model = KdlFrankaModel(text, "panda")
        self.reports: list[str] = []
        parameters = BoxConfig(**config)
        self.box = ControlBox(
            model, CompiledArm(text, "panda", parameters.min_singular_value), parameters, self.reports.append
        )
        self.state = self.box.state
        self.plant = plugins.find(plugins.PLANT, "pybullet_ros_control/PyBulletPlant")(
            text, model.joint_names, {**PLANT, **plant}
        )
        self._row = [0.0] * 7, [0.0] * 7, [0.0] * 7
        self.cycles = 0
        self.place(q)

    def place(self, q: list[float]) -> None:
        self.plant.reset(q)
        self.box.reset(q)
        self._read()

    def _read(self) -> None:
        self.plant.read_state(*self._row)
        self.box.read(*self._row, self.cycles * 1e-3)

    def cycle(self, command: MotionCommand | None = None) -> None:
        self.plant.apply(self.box.write(command))
        self.plant.step()
        self.cycles += 1
        self._read()

    def start(
        self,
        controller: ControllerMode = ControllerMode.EXTERNAL,
        generator: GeneratorMode = GeneratorMode.NONE,
        **kwargs: Any,
    ) -> None:
        """Start a motion, and run the two cycles whose states a client reads before its first command."""
        assert self.box.move(MoveRequest(controller, generator, **kwargs)) is RequestOutcome.STARTED
        self.cycle()
        self.cycle()

    def until_reflex(self, command: Callable[[], MotionCommand | None], cycles: int) -> frozenset[str]:
        """Run cycles until the motion ends; return the errors that are set then."""
        for _ in range(cycles):
            self.cycle(command())
            if self.box.mode is not RobotMode.MOVE:
                break
        return self.state.current_errors


def torques(*tau: float, finished: bool = False) -> MotionCommand:
    """Return a torque command; zero by default."""
    return MotionCommand([0.0] * 7, [0.0] * 7, [0.0] * 16, [0.0] * 6, None, list(tau) or [0.0] * 7, finished)


@pytest.fixture(name="torques")
def torques_fixture() -> Callable[..., MotionCommand]:
    return torques


Q_BOX = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]


@pytest.fixture
def make_box() -> Iterator[Callable[..., BoxArm]]:
    """make_box(plant={...}, config={...}, q=[...], hand=True, ...) -> BoxArm; the other arguments are those of the
    description."""
    made: list[BoxArm] = []

    def make(
        plant: dict[str, Any] | None = None,
        config: dict[str, Any] | None = None,
        q: list[float] | None = None,
        **urdf: Any,
    ) -> BoxArm:
        made.append(BoxArm(plant or {}, config or {}, q or Q_BOX, urdf))
        return made[-1]

    yield make
    for arm in made:
        arm.plant.close()
