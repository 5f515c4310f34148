"""Bring-up in a separate network namespace: listening sockets, and no effect of an attack from another machine."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path

import numpy as np
import pytest
import yaml
from attacker import FIRST
from live_system import ROOT, LiveSystem, wait_for
from neighbour import LAB, NEIGHBOUR, Bound, Network
from rosbags.highlevel import AnyReader

from hric_core.wires import GROUP, WIRES, Wire

pytestmark = pytest.mark.alone

FRAMES = "/hric/perception/mocap"
OTHERS = (
    ("scripts/scheduler", "--port", "8786"),
    ("scripts/worker", "tcp://127.0.0.1:8786", "--workers", "1"),
    ("scripts/docs", "--serve"),
    ("devel/bin/hric", "ur_controller", "--ip", "127.0.0.1"),
)
"""Programs with ports that no bring-up starts; the worker waits for the scheduler."""
FILE = ROOT / "src/hric_experiments/config/experiments/data_collection.yaml"


@dataclass(frozen=True)
class Attacked:
    """Result of a bring-up that has ended.

    Attributes:
        bound: listening sockets of the bring-up and of the programs in `OTHERS`.
        result: result of the attacker.
        output: output of the bring-up.
        bag: recorded bag.
    """

    bound: list[Bound]
    result: dict[str, list[object]]
    output: str
    bag: Path


def experiment(folder: Path) -> Path:
    """Return arguments for devices of every kind: motion capture, EMG by Trigno, a force plate by LSL."""
    content = yaml.safe_load(FILE.read_text())
    content["setpoints"], content["duration"] = [{**content["setpoints"][0], "time": 0.5}], 300.0  # ended before
    content["emg"]["transport"] = "trigno"
    path = folder / "wires.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.fixture(scope="module")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Attacked]:
    """Bring-up run once for all tests; by an argument, the neighbour can reach its motion capture address only."""
    folder = tmp_path_factory.mktemp("wires")
    with ExitStack() as stack:
        try:
            network = Network()
        except (RuntimeError, OSError) as error:
            pytest.skip(str(error))
        stack.callback(network.close)
        if not (ROOT / ".venv-docs/installed").is_file():  # the laboratory has no network to install packages from
            subprocess.run([f"{ROOT}/scripts/docs", "--check"], check=True, stdout=subprocess.DEVNULL)
        words = [f"{ROOT}/scripts/bringup", "env:=real", "robot_ip:=emulated", "rviz:=false", "view:=web"]
        system = LiveSystem(
            folder,
            *network.command(network.lab, *words, f"experiment:={experiment(folder)}", f"mocap_server:={LAB}")[1:],
            program="ip",
        )
        stack.callback(system.close)
        for program, *arguments in OTHERS:
            other = subprocess.Popen(
                network.command(network.lab, f"{ROOT}/{program}", *arguments),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            stack.callback(lambda other=other: (other.terminate(), other.wait()))
        system.wait_output("recording", 120.0)
        with suppress(AssertionError):  # the test of the rows names those that nothing opened
            wait_for(
                lambda: system.process.poll() is not None or not unopened(list(network.listening())), 270.0, "every row"
            )
        bound = list(network.listening())
        sockets = json.dumps([(one.transport, one.port) for one in bound])
        attacker = str(Path(__file__).with_name("attacker.py"))
        port = system.uri.rpartition(":")[2]
        attack = subprocess.run(
            network.command(network.neighbour, sys.executable, attacker, LAB, sockets, f"hric_{port}"),
            capture_output=True,
            text=True,
            timeout=120.0,
        )
        assert attack.returncode == 0, attack.stderr
        system.interrupt()
        (bag,) = system.run_folder.glob("*.bag")
        yield Attacked(bound, json.loads(attack.stdout), system.output, bag)


def covers(wire: Wire, one: Bound) -> bool:
    """Return True if a socket is listed in a row of the table."""
    names = {word.rpartition("/")[2] for word in one.words}
    is_node = any(word.startswith("__name:=") for word in one.words)
    is_program = bool(names.intersection(wire.programs)) if wire.programs else is_node
    known = ip_address(one.address).is_loopback or (wire.address_argument and one.address in (LAB, GROUP))
    return is_program and known and one.transport == wire.transport and wire.ports[0] <= one.port <= wire.ports[1]


def unopened(bound: list[Bound]) -> list[str]:
    """Return the rows of the table without an open socket."""
    return [wire.who for wire in WIRES if not any(covers(wire, one) for one in bound)]


def test_every_port_is_one_of_the_table(attacked: Attacked) -> None:
    assert len(attacked.bound) > 30
    unlisted = [one for one in attacked.bound if not any(covers(wire, one) for wire in WIRES)]
    assert [(*one[:3], " ".join(one.words)[:150]) for one in unlisted] == []


def test_every_row_of_the_table_is_opened_by_a_program(attacked: Attacked) -> None:
    assert unopened(attacked.bound) == []


def test_a_neighbour_finds_no_port_of_tcp_and_no_stream(attacked: Attacked) -> None:
    assert attacked.result == {"opened": [], "streams": []}


def test_no_forged_frame_is_taken_and_the_neighbour_is_named_once(attacked: Attacked, figure: Callable) -> None:
    with AnyReader([attacked.bag]) as reader:
        frames = [item for item in reader.connections if item.topic == FRAMES]
        numbers = [reader.deserialize(raw, one.msgtype).frame_number for one, _, raw in reader.messages(frames)]
    assert len(numbers) > 100 and max(numbers) < FIRST
    assert np.all(np.diff(numbers) > 0)
    assert attacked.output.count(f"packets of {NEIGHBOUR}:") == 1
    figure("sockets of a bring-up with every device", len(attacked.bound), "1")
