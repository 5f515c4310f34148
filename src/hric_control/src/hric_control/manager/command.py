"""Command-line tool `controller_manager`: each command is a request to a controller manager."""

import argparse
import time
from collections.abc import Callable, Sequence
from typing import Any

from hric_control.manager.client import ManagerClient, check_master
from hric_control.manager.spawner import read_words, run_tool

_NAMED: dict[str, str] = {
    "load": "load controllers",
    "unload": "unload controllers",
    "start": "start loaded controllers, in one switch",
    "stop": "stop running controllers, in one switch",
    "spawn": "load and start controllers",
    "kill": "stop and unload controllers",
}


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser of the tool."""
    top = argparse.ArgumentParser(
        prog="controller_manager", description="List, load, start or stop the controllers of a robot."
    )
    top.add_argument(
        "--namespace", metavar="NS", default="", help="namespace of the robot, where controller_manager stands"
    )
    top.add_argument(
        "--timeout", metavar="T", type=float, default=30.0, help="how long to wait for the services [s] (default: 30)"
    )
    commands = top.add_subparsers(dest="command", required=True, metavar="command")
    commands.add_parser("list", aliases=["lc"], help="list the loaded controllers with state, type and claimed joints")
    commands.add_parser("list-types", aliases=["lt"], help="list the types that can be loaded")
    for name, text in _NAMED.items():
        aliases = {"spawn": ["sp"], "kill": ["kl"]}.get(name, [])
        commands.add_parser(name, aliases=aliases, help=text).add_argument(
            "controllers", nargs="+", metavar="controller", help="name"
        )
    reload = commands.add_parser(
        "reload-libraries", help="stop and unload all controllers, then load their modules again"
    )
    reload.add_argument(
        "--restore", action="store_true", help="load the controllers again afterwards and start those that ran"
    )
    return top


def run(argv: Sequence[str]) -> int:
    """Run the program `controller_manager` and return its exit code."""
    args = read_words(parser(), argv)

    def work() -> None:
        check_master()
        client = ManagerClient(args.namespace)
        client.wait(args.timeout, print)
        _COMMANDS[args.command](client, args)

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


def _load(client: ManagerClient, args: argparse.Namespace) -> None:
    for name in args.controllers:
        client.load(name)
        print(f"loaded {name}")


def _unload(client: ManagerClient, args: argparse.Namespace) -> None:
    for name in args.controllers:
        client.unload(name)
        print(f"unloaded {name}")


def _start(client: ManagerClient, args: argparse.Namespace) -> None:
    client.switch(args.controllers, [])
    print(f"started {', '.join(args.controllers)}")


def _stop(client: ManagerClient, args: argparse.Namespace) -> None:
    client.switch([], args.controllers)
    print(f"stopped {', '.join(args.controllers)}")


def _spawn(client: ManagerClient, args: argparse.Namespace) -> None:
    _load(client, args)
    _start(client, args)


def _kill(client: ManagerClient, args: argparse.Namespace) -> None:
    _stop(client, args)
    _unload(client, args)


def _reload(client: ManagerClient, args: argparse.Namespace) -> None:
    before: Sequence[Any] = client.list()
    begin = time.monotonic()
    client.reload(force_kill=True)
    print(f"reloaded in {time.monotonic() - begin:.2f} s")
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


_COMMANDS: dict[str, Callable[[ManagerClient, argparse.Namespace], None]] = {
    "list": _list,
    "lc": _list,
    "list-types": _list_types,
    "lt": _list_types,
    "load": _load,
    "unload": _unload,
    "start": _start,
    "stop": _stop,
    "spawn": _spawn,
    "sp": _spawn,
    "kill": _kill,
    "kl": _kill,
    "reload-libraries": _reload,
}
