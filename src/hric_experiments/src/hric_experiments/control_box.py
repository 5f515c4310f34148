"""Command `control_box`: emulated control boxes with the arm, or the arms, of an experiment in one world."""

import argparse
import ipaddress
from typing import Any

from franka_sim.fci.app import Arms, ControlBoxCommand
from hric_core.command import Argument
from hric_core.errors import ParameterError
from hric_experiments.cli import experiment_arguments, sort_words
from hric_run.definition import experiment

OF_ONE_ARM = (
    *(
        "robot",
        "no_hand",
        "vacuum",
        "q_start",
        "plant",
        "rotor_inertia",
        "friction",
        "realism",
        "no_collision",
        "world",
        "gui",
    ),
    *("no_reflexes", "constant"),
)
"""Arguments that describe the arm and its surroundings, and are refused with an experiment, which does so itself."""


class ExperimentBoxCommand(ControlBoxCommand):
    """Emulate Panda or FR3 arms, their control boxes and hands, to which an unmodified libfranka connects.

    Without an experiment, the arguments describe one arm. With an experiment, its arms stand in one world, with its
    person and objects, and each has a control box of its own. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        text = "experiment with the arms: a name, the path of a YAML file, or none (with overrides only)"
        return [*experiment_arguments(text), *super().arguments()]

    def arms(self, options: argparse.Namespace) -> Arms:
        """Construct the emulated arms of the experiment, or the arm that the arguments describe. Raises HricError."""
        if options.experiment is None:
            return super().arms(options)
        sort_words(options)
        usual = self.parser().parse_args([])
        for name in OF_ONE_ARM:
            if getattr(options, name) != getattr(usual, name):
                raise ParameterError(
                    f"--{name.replace('_', '-')} and the experiment {options.experiment} both describe the arm; valid: "
                    "an override of the experiment, such as simulator:=mujoco"
                )
        definition = experiment.load(options.experiment, ["hw:=franka_sim/FrankaHWSim", *options.overrides])
        # Imported only for an experiment, as engines and models are slow to import.
        from franka_sim.fci.arm_input import read_arm
        from franka_sim.fci.world_building import build_world, served_arms
        from hric_control.sim.combined_hw_sim import robot_nodes
        from hric_core.local.node import LocalNode
        from hric_run.definition import parameters

        root = LocalNode(_parameters(definition, options))
        node = root.child(parameters.ROBOT)
        nodes = {name: private for name, (_, private) in robot_nodes(root, node).items()} if definition.arms else {}
        inputs = {
            name: read_arm(private, options.max_lost_packets or None)
            for name, private in (nodes or {definition.robot.arm_id: node}).items()
        }
        world = build_world(inputs, node)
        return served_arms(inputs, world), world.close


def _parameters(definition: experiment.Experiment, options: argparse.Namespace) -> dict[str, Any]:
    """Return all parameters of the experiment's robots, with type and address of each control box.

    Unless the experiment sets them, the addresses count upwards from `--ip`, and the type follows from the inertial
    parameters. Raises HricError for a robot that is no Franka arm.
    """
    from hric_run.definition import parameters

    tree = parameters.namespace(definition, options.seed)
    arms = definition.each_arm() if definition.arms else {}
    robots = [(tree[parameters.ROBOT]["arms"][name], part) for name, part in arms.items()] or [(tree, definition)]
    for index, (values, part) in enumerate(robots):
        if part.robot.urdf:
            raise experiment.ExperimentError(
                f"experiment {definition.name}: {part.robot.urdf} has no control box; valid: Franka arms"
            )
        kind = "fr3" if part.robot.description.get("inertials") == "fr3" else "panda"
        ip = ipaddress.IPv4Address((int(ipaddress.IPv4Address(options.ip)) + index) % 2**32)
        values[parameters.ROBOT] = {"robot": kind, "ip": str(ip), **values[parameters.ROBOT]}
    return tree
