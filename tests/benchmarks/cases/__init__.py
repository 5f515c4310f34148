"""Cases of the benchmark by name.

A case is a context manager that yields a function; a call of this function does a block of work and returns the time of
one unit of it [s].
"""

import importlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

Block = Callable[[], float]
REFERENCE = "bare/pybullet"
"""Name of the case to which most others are ratios: a bare step of PyBullet."""
PANDA = "bare/panda"
"""Name of the reference of learning environments: a bare step of the Panda that other environments load."""


@dataclass(frozen=True)
class Case:
    """Case of the benchmark, which is one row of the table.

    Attributes:
        what: description of the measured work.
        unit: unit of the work, such as "step".
        make: module of this package, and function that returns the context manager.
        arguments: arguments of the function.
        rounds: number of blocks per process.
        several: True if several processes work, so that wall time is measured instead of processor time.
        reference: name of the case to which this one is a ratio.
    """

    what: str
    unit: str
    make: tuple[str, str]
    arguments: dict[str, Any]
    rounds: int = 20
    several: bool = False
    reference: str = REFERENCE


ROBOTS = {
    "generic": ("RobotHWSim", {"rotor_inertia": 0.0}),
    "rotors": ("RobotHWSim with rotors", {"rotor_inertia": 0.1}),
    "full": ("RobotHWSim with rotors and friction", {"rotor_inertia": 0.1, "friction": "identified"}),
    "franka": ("FrankaHWSim", {"rotor_inertia": 0.1}),
}
"""Robots whose control cycle is measured: description, and parameters of the plant."""
TIMED = {
    "pybullet": ("generic", "rotors", "franka"),
    "mujoco": ("generic", "rotors", "franka"),
    "opensim": ("generic", "full", "franka"),
}
"""Measured control cycles of each engine."""
FIRST_ORDER_UNTIMED = (("pybullet", "franka"), ("opensim", "full"), ("opensim", "franka"))
"""Engines and robots whose cycle is measured with the integrator `accurate` only."""


def _cycles() -> dict[str, Case]:
    found = {}
    for engine, robots in TIMED.items():
        for robot in robots:
            for integrator in ("accurate", "semi_implicit"):
                if integrator == "semi_implicit" and (engine, robot) in FIRST_ORDER_UNTIMED:
                    continue
                text, plant = ROBOTS[robot]
                arguments = {"robot": robot, "simulator": engine, "integrator": integrator, **plant}
                suffix = "" if integrator == "accurate" else f"/{integrator}"
                what = f"{text} on {engine}, {integrator}"
                found[f"cycle/{engine}/{robot}{suffix}"] = Case(what, "cycle", ("arms", "cycle"), arguments)
    return found


BESIDE = {
    "alone": "RobotHWSim with rotors",
    "arm": "and a human arm with its law beside it",
    "grip": "and a human hand that grips it",
    "muscles": "and 34 muscles that move it",
}
"""Persons next to the robot in a measured cycle: description by name."""


def _humans() -> dict[str, Case]:
    found = {}
    for engine in TIMED:
        for beside, text in BESIDE.items():
            given = {"robot": "rotors", "simulator": engine, "rotor_inertia": 0.1, "beside": beside}
            found[f"human/{engine}/{beside}"] = Case(f"{text}, on {engine}", "cycle", ("arms", "cycle"), given)
    return found


def _environments() -> dict[str, Case]:
    """Return the cases of the learning environment: a millisecond of its steps, and the begin of an episode."""
    alone, joints = {"person": "none"}, {"action": "joint_velocity"}
    persons = {
        "arm": (alone, "the arm alone"),
        "person": ({"drive": "torque"}, "a person by torque"),
        "muscles": ({"drive": "muscle"}, "a person by muscles"),
    }
    steps = {
        "joints": (joints | alone, "the arm by joint velocities"),
        "targets": ({"action": "joint_position"} | alone, "the arm by joint positions"),
        "cartesian": ({"action": "end_effector"} | alone, "the arm by Cartesian impedance"),
        "impedance": ({"action": "impedance"} | alone, "the arm by Cartesian impedance with commanded stiffness"),
        **{name: (joints | given, f"the arm by joint velocities, {text}") for name, (given, text) in persons.items()},
    }
    del steps["arm"]
    resets = persons | {"body": ({"population": "adult_mixed"}, "a person by torque, another body")}
    found = {}
    for name, (given, text) in steps.items():
        what = f"an environment: {text}"
        found[f"environment/{name}"] = Case(what, "ms of robot time", ("environment", "step"), given, reference=PANDA)
    for name, (given, text) in resets.items():
        what = f"an episode begins: {text}"
        found[f"reset/{name}"] = Case(what, "reset", ("environment", "reset"), given, reference=PANDA)
    return found


def _runs() -> dict[str, Case]:
    found = {}
    for engine in ("pybullet", "mujoco"):
        what, given = f"a headless pd_step of 6 s on {engine}, bag and metrics", {"simulator": engine}
        found[f"run/{engine}/again"] = Case(f"{what}, after another one", "run", ("runs", "again"), given, 4)
        found[f"run/{engine}/fresh"] = Case(f"{what}, in a new process", "run", ("runs", "fresh"), given, 2)
    return found


def _fci() -> dict[str, Case]:
    """Return the cases of a control loop through libfranka, with the emulated control box and with a constant state."""
    found = {}
    for robot in ("panda", "fr3"):
        for suffix, words in (("", ()), ("/constant", ("--constant",))):
            what = f"a cycle through libfranka, {robot}" + (", against a constant state" if words else "")
            given = {"robot": robot, "words": words}
            found[f"fci/{robot}{suffix}"] = Case(what, "cycle", ("wires", "fci"), given, 4, several=True)
    return found


CASES: dict[str, Case] = {
    REFERENCE: Case("PyBullet's own step of the arm", "step", ("arms", "bare_pybullet"), {}),
    PANDA: Case(
        "PyBullet's own step of the Panda with hand of pybullet_data", "step", ("environment", "bare_panda"), {}
    ),
    "bare/mujoco/accurate": Case("MuJoCo's step, Runge-Kutta", "step", ("arms", "bare_mujoco"), {"integrator": "RK4"}),
    "bare/mujoco/semi_implicit": Case(
        "MuJoCo's step, implicitfast", "step", ("arms", "bare_mujoco"), {"integrator": "IMPLICITFAST"}
    ),
    "bare/opensim/installed": Case(
        "OpenSim's step as it loads itself", "step", ("opensim_steps", "third_order"), {"loaded_first": False}
    ),
    "bare/opensim/accurate": Case(
        "OpenSim's step, its libraries loaded as the plant does", "step", ("opensim_steps", "third_order"), {}
    ),
    "bare/opensim/semi_implicit": Case("Euler's method on OpenSim", "step", ("opensim_steps", "semi_implicit"), {}),
    "plain/pybullet": Case("a PD law in a plain loop on PyBullet", "cycle", ("arms", "plain_pybullet"), {}),
    "plain/mujoco": Case("a PD law in a plain loop on MuJoCo", "cycle", ("arms", "plain_mujoco"), {}),
    **_cycles(),
    **_humans(),
    "human/law": Case("the human's law, and nothing else", "cycle", ("arms", "human_law"), {"muscles": False}),
    "human/muscles": Case(
        "the human's law and 34 muscles, and nothing else", "cycle", ("arms", "human_law"), {"muscles": True}
    ),
    **_environments(),
    **_runs(),
    "live/unpaced": Case("a cycle with ROS and recording", "cycle", ("runs", "live"), {}, 1, several=True),
    **_fci(),
    "natnet/frame": Case("a frame of one body decoded", "frame", ("wires", "natnet_frame"), {}),
    "sync/1000hz": Case("synchronising at 1 kHz", "s of robot time", ("wires", "synchroniser"), {}, 1, several=True),
    "convert/panda": Case("the Panda's URDF into OpenSim's model", "model", ("conversion", "convert"), {}, 4),
}


def make(name: str) -> AbstractContextManager[Block]:
    """Return the context manager of a case."""
    module, function = CASES[name].make
    made: AbstractContextManager[Block] = getattr(importlib.import_module(f"cases.{module}"), function)(
        **CASES[name].arguments
    )
    return made
