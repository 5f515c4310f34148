"""Command-line tool `controller_manager`: each command sends requests to a robot's controller manager."""

import argparse
import time
from collections.abc import Sequence
from typing import Any

from hric_control.manager.client import ManagerClient, check_master
from hric_control.manager.spawner import read_words, run_tool

_NAMED: dict[str, tuple[list[str], str, list[str]]] = {
    "load": ([], "load controllers", ["load"]),
    "unload": ([], "unload controllers", ["unload"]),
    "start": ([], "start loaded controllers, in one switch", ["start"]),
    "stop": ([], "stop running controllers, in one switch", ["stop"]),
    "spawn": (["sp"], "load and start controllers", ["load", "start"]),
    "kill": (["kl"], "stop and unload controllers", ["stop", "unload"]),
}
"""Commands that take controllers' names: their aliases, help text, and actions in order."""


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser of the tool."""
    top = argparse.ArgumentParser(
        prog="controller_manager", description="List, load, start or stop the controllers of a robot."
    )
    top.add_argument(
        "--namespace", metavar="NS", default="", help="namespace of the robot, which contains controller_manager"
    )
    top.add_argument(
        "--timeout", metavar="T", type=float, default=30.0, help="longest wait for the services [s] (default: 30)"
    )
    commands = top.add_subparsers(dest="command", required=True, metavar="command")
    loaded = "list the loaded controllers with state, type and claimed joints"
    commands.add_parser("list", aliases=["lc"], help=loaded).set_defaults(work=_list)
    commands.add_parser("list-types", aliases=["lt"], help="list the types that can be loaded").set_defaults(
        work=_list_types
    )
    for name, (aliases, text, verbs) in _NAMED.items():
        command = commands.add_parser(name, aliases=aliases, help=text)
        command.add_argument("controllers", nargs="+", metavar="controller", help="name of a controller")
        command.set_defaults(work=_named, verbs=verbs)
    reload = commands.add_parser(
        "reload-libraries", help="stop and unload all controllers, then load their modules again"
    )
    reload.set_defaults(work=_reload)
    reload.add_argument(
        "--restore", action="store_true", help="load the controllers again afterwards and start those that were running"
    )
    return top


def run(argv: Sequence[str]) -> int:
    """Run the program `controller_manager` and return its exit code."""
    args = read_words(parser(), argv)

    def work() -> None:
        check_master()
        client = ManagerClient(args.namespace)
        client.wait(args.timeout, print)
        args.work(client, args)

    return run_tool("controller_manager", work)


def _list(client: ManagerClient, args: argparse.Namespace) -> None:
    controllers = client.list()
    if not controllers:
        print("no controllers are loaded")
    for controller in controllers:
        claims = "; ".join(
            f"{claim.hardware_interface}: {', '.join(claim.resources)}" for claim in controller.claimed_resources
        )
        print(f"{controller.name} - {controller.type} ( {controller.state} )" + (f" claims {claims}" if claims else ""))


def _list_types(client: ManagerClient, args: argparse.Namespace) -> None:
    for name, base in client.types():
        print(f"{name} [{base}]")


def _named(client: ManagerClient, args: argparse.Namespace) -> None:
    for verb in args.verbs:
        if verb in ("load", "unload"):
            for name in args.controllers:
                getattr(client, verb)(name)
                print(f"{verb}ed {name}")
        else:
            client.switch(*((args.controllers, []) if verb == "start" else ([], args.controllers)))
            print(f"{verb}{'ped' if verb == 'stop' else 'ed'} {', '.join(args.controllers)}")


def _reload(client: ManagerClient, args: argparse.Namespace) -> None:
    before: Sequence[Any] = client.list()
    begin = time.monotonic()
    client.reload(force_kill=True)
    print(f"controller modules reloaded in {time.monotonic() - begin:.2f} s")
    if args.restore:
        for controller in before:
            client.load(controller.name)
        running = [controller.name for controller in before if controller.state == "running"]
        if running:
            client.switch(running, [])
        print(
            f"restored {', '.join(controller.name for controller in before) or 'nothing'}; running: "
            f"{', '.join(running) or 'none'}"
        )
