"""Sections emg, force_plate and sync of an experiment file: content, parameters of the nodes, messages for mistakes."""

import subprocess
import sys
from typing import Any

import pytest

from hric_core.errors import HricError
from hric_perception.emg.muscles import MUSCLES
from hric_report import headless
from hric_run.definition import experiment, overrides, parameters
from hric_run.definition.experiment import ExperimentError


def load(name: str, *given: str) -> experiment.Experiment:
    return experiment.parse(name, overrides.apply(experiment.read(name), given))


def nodes(*given: str, name: str = "data_collection") -> dict[str, dict[str, Any]]:
    return parameters.sensors(load(name, *given), seed=3)


def signals(plan: dict[str, Any], topic: str) -> list[str]:
    found = next(source["signals"] for source in plan["sources"] if source["topic"] == topic)
    return [signal if isinstance(signal, str) else signal["field"] for signal in found]


def test_the_data_collection_has_every_sensor_at_the_requested_rates() -> None:
    run = load("data_collection")
    assert run.duration == 60.0 and run.mocap is not None and run.sync is not None
    assert run.emg is not None and (len(run.emg.channels), run.emg.rate, run.emg.time_code) == (8, 2000.0, True)
    assert run.force_plate is not None and (run.force_plate.rate, run.force_plate.time_code) == (1000.0, True)
    assert run.sync.rates == (100.0, 1000.0)
    assert run.sync.topics == ["hric/perception/sync_100hz", "hric/perception/sync_1000hz"]


def test_the_sections_are_read_where_pylsl_is_not_installed() -> None:
    code = "import sys; sys.modules['pylsl'] = None\nfrom hric_run.definition import experiment"
    subprocess.run([sys.executable, "-c", f"{code}; experiment.load('data_collection')"], check=True)


def test_every_node_gets_its_parameters_from_the_sections(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "http://localhost:11999")
    found = nodes("force_plate.id:=left", "emg.envelope:={lowpass: 3}")
    assert sorted(found) == ["emg", "emulated_emg", "emulated_plate", "force_plate", "synchronizer"]
    assert found["emg"] == {
        "source": "lsl",
        "chunk": 0.05,
        "envelope": {"lowpass": 3},
        "lsl": {"name": "emulated_emg", "session": "hric_11999"},
    }
    emulated = found["emulated_emg"]
    assert (emulated["name"], emulated["session"]) == ("emulated_emg", "hric_11999"), (
        "a bring-up hears its own devices alone"
    )
    assert (emulated["muscles"], emulated["rate"], emulated["seed"], emulated["faults"]) == (
        list(MUSCLES),
        2000.0,
        3,
        {"time_code": True},
    )
    assert found["force_plate"]["id"] == "left" and found["emulated_plate"]["pose"] == {"xyz": [0.5, 0.0, 0.05]}
    assert found["synchronizer"]["rates"] == [100.0, 1000.0]


def test_what_is_synchronised_follows_the_sections() -> None:
    plan = nodes("emg.channels:=4", "force_plate.id:=left", "arm_id:=other")["synchronizer"]["plan"]
    assert [source["topic"] for source in plan["sources"]] == [
        "control_log",
        "hric/perception/mocap",
        "hric/perception/emg/raw",
        "hric/perception/force_plate/left/samples",
    ]
    assert signals(plan, "control_log")[0].startswith("position[other_joint1, other_joint2")
    assert signals(plan, "hric/perception/emg/raw") == [f"data[{', '.join(MUSCLES[:4])}]", "data[time]"]


def test_real_devices_take_the_place_of_the_emulated_ones() -> None:
    found = nodes("emg.device:=real", "emg.channels:=[biceps, triceps]", "force_plate.device:=none")
    assert sorted(found) == ["emg", "synchronizer"]
    assert found["emg"] == {"source": "lsl", "chunk": 0.05}, "any stream of type EMG in the network"
    plan = found["synchronizer"]["plan"]
    assert signals(plan, "hric/perception/emg/raw") == ["data[biceps, triceps]"], "a real device has no time code"
    assert not any("force_plate" in source["topic"] for source in plan["sources"])


def test_emg_comes_from_a_trigno_server_likewise() -> None:
    found = nodes("emg.transport:=trigno", "emg.channels:=2", "emg.trigno:={host: 127.0.0.9, data_port: 50050}")
    assert found["emg"]["trigno"] == {"host": "127.0.0.9", "data_port": 50050, "channels": [*MUSCLES[:2], "time"]}
    assert (found["emulated_emg"]["ip"], found["emulated_emg"]["data_port"]) == ("127.0.0.9", 50050)


def test_the_bring_up_may_add_a_sensor_to_any_experiment_by_its_device() -> None:
    assert sorted(nodes("emg.device:=emulated", name="pd_step")) == ["emg", "emulated_emg"]
    assert nodes(name="pd_step") == {}


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("emg.channels:=0", "emg.channels is 0; valid: 1 to 8 of the usual muscles, or a list"),
        ("emg.channels:=[a, a]", "a list of up to 64 names, all different"),
        ("emg.rate:=50", "emg.rate is 50; valid: a finite number from 100 to 20000"),
        ("emg.transport:=usb", "emg.transport is 'usb'; valid: lsl, trigno"),
        ("emg.device:=maybe", "emg.device is 'maybe'; valid: emulated, real, none"),
        ("emg.envelope.lowpass:=-1", "emg.envelope.lowpass is -1"),
        ("emg.emulated.faults.noise:=-1", "emg.emulated.faults.noise is -1"),
        (
            "emg.emulated.activation.program:=dance",
            "no program 'dance' in emg.emulated.activation; valid: bursts, c3d, constant",
        ),
        ("emg.colour:=red", "'colour' is not one of channels, chunk, device"),
        ("emg:=3", "no override 'emg'"),
        ("force_plate.id:=a b", "force_plate.id is 'a b'; valid: letters"),
        ("force_plate.pose.xyz:=[1]", "force_plate.pose.xyz"),
        ("force_plate.emulated.load.force:=-1", "force_plate.emulated.load.force is -1"),
        ("force_plate.lsl.kind:=x", "no parameter 'kind' in force_plate.lsl; valid: name, session, source_id, type"),
        ("sync.rates:=[]", "sync.rates"),
        ("sync.rates:=[100, 100]", "each a finite number above 0 to 10000 .Hz., all different"),
        ("sync.delay:=-1", "sync.delay is -1"),
    ],
)
def test_a_mistake_in_a_sensor_is_refused_by_its_full_name(given: str, told: str) -> None:
    with pytest.raises(ExperimentError, match=told):
        load("data_collection", given)


def test_an_experiment_without_the_sensor_says_so() -> None:
    for given, name in (
        ("emg.channels:=4", "EMG"),
        ("force_plate.id:=2", "force plate"),
        ("sync.rates:=[1]", "synchroniser"),
    ):
        with pytest.raises(ExperimentError, match=f"this experiment has no {name}"):
            load("pd_step", given)


def test_the_headless_runner_has_no_wires_and_refuses_by_name(tmp_path: Any) -> None:
    with pytest.raises(
        HricError,
        match=r"data_collection has sync, which needs a network connection .*; valid: scripts/bringup",
    ):
        headless.run(load("data_collection"), root=tmp_path)
    assert list(tmp_path.iterdir()) == []
