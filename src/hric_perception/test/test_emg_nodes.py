"""The nodes `emulated_emg` and `emg` as processes, in robot time that the test publishes."""

import os
import time

import numpy as np
import pytest
from real_master import free_port, ros, roscore
from sensor_nodes import LIMIT, Diagnosis, Nodes, TellsTime, TopicActivation, nodes, run, wait
from std_srvs.srv import SetBool

from hric_perception.chunk import Chunk

__all__ = ["nodes", "ros", "roscore", "run"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
SETTLED = 1.0
"""After a pause the line through the pairs is settled [s of robot time]: at half pace 2 s of wall time, of which the
line takes 0.4; the rest is for pairs that come late on a busy machine."""


def errors(chunks: list[Chunk]) -> np.ndarray:
    """Return stamps minus time codes [s]."""
    return np.concatenate([chunk.times - chunk.data[:, -1] for chunk in chunks])


def test_stamps_over_lsl_are_the_robot_time_of_the_samples_at_half_pace_and_after_a_pause(
    run: TellsTime, nodes: Nodes
) -> None:
    run.pace = 0.5
    raw, smooth, health = (
        TopicActivation("/hric/perception/emg/raw"),
        TopicActivation("/hric/perception/emg/envelope"),
        Diagnosis("emg"),
    )
    session = f"test_emg_{os.getpid()}"
    device = nodes.start("emulated_emg", f"_session:={session}", "_muscles:=8", "_faults:={time_code: true}")
    driver = nodes.start("emg", f"_lsl:={{session: {session}}}", "_envelope:={mvc: {biceps: 0.001}}")
    wait(lambda: len(raw.chunks) > 100)
    paused, run.pace = run.time, 0.0
    time.sleep(0.5)
    stood = len(raw.chunks)
    wait(lambda: health.says("the run is paused"))
    assert len(raw.chunks) <= stood + 1
    run.pace = 0.5
    wait(lambda: raw.end > paused + SETTLED + 0.7)
    outputs = nodes.end(driver) + nodes.end(device)
    assert "Traceback" not in outputs
    raw.close()
    smooth.close()
    numbers = np.concatenate([np.arange(chunk.first, chunk.after) for chunk in raw.chunks])
    codes = np.concatenate([chunk.data[:, -1] for chunk in raw.chunks])
    assert np.allclose(np.diff(codes), np.diff(numbers) / 2000.0, atol=1e-9)
    settled = (codes < paused) | (codes > paused + SETTLED)
    assert np.abs(errors(raw.chunks))[settled].max() < 2e-4
    assert raw.chunks[0].layout.channels[-1] == "time" and smooth.chunks[0].layout.channels[4] == "biceps"
    assert smooth.chunks[0].layout.units[4] == "MVC" and smooth.chunks[0].layout.rate == 200.0
    assert max(chunk.data.max() for chunk in smooth.chunks) > 0.05


@pytest.mark.slow  # test_lsl.py has it without the nodes
def test_a_device_that_dies_and_comes_back_is_reported_and_drop_outs_show(run: TellsTime, nodes: Nodes) -> None:
    raw, health = TopicActivation("/hric/perception/emg/raw"), Diagnosis("emg")
    session = f"test_dying_{os.getpid()}"
    options = (f"_session:={session}", "_muscles:=[flexor, extensor]", "_rate:=1000")
    driver = nodes.start("emg", f"_lsl:={{session: {session}}}", "_envelope:={band: [20, 400]}")
    device = nodes.start("emulated_emg", *options, "_faults:={time_code: true}")
    wait(lambda: len(raw.chunks) > 100)
    device.kill()
    device.communicate()
    wait(lambda: health.says("is not found") or health.says("was lost"))
    begin = len(raw.chunks)
    device = nodes.start(
        "emulated_emg", *options, "_faults:={time_code: true, dropout_rate: 2.0, dropout_length: 0.02}"
    )
    wait(lambda: health.says("samples lost") and len(raw.chunks) > begin + 200)
    assert health.says("the source restarted")
    assert np.abs(errors(raw.chunks[-150:])).max() < 2e-3
    nodes.end(device)
    assert driver.poll() is None
    nodes.end(driver)
    raw.close()


def test_over_trigno_the_stamps_stay_within_the_declared_bound_and_the_contraction_is_measured(
    run: TellsTime, nodes: Nodes
) -> None:
    import rospy

    raw = TopicActivation("/hric/perception/emg/raw")
    command, data = free_port(), free_port()
    ports = (f"_command_port:={command}", f"_data_port:={data}")
    activation = "_activation:={program: constant, level: 0.5}"
    device = nodes.start(
        "emulated_emg", "_transport:=trigno", "_muscles:=[flexor]", activation, *ports, "_faults:={time_code: true}"
    )
    trigno = f"_trigno:={{channels: [flexor, time], command_port: {command}, data_port: {data}}}"
    driver = nodes.start("emg", "__name:=emg_trigno", "_source:=trigno", trigno)
    wait(lambda: len(raw.chunks) > 100)
    record = rospy.ServiceProxy("/emg_trigno/record_mvc", SetBool)
    assert record(True).success
    wait(lambda: raw.end > raw.chunks[0].start + 3.0)
    answer = record(False)
    assert answer.success and "flexor" in answer.message
    assert 2e-4 < rospy.get_param("/emg_trigno/measured_mvc")["flexor"] < 8e-4
    late = [chunk for chunk in raw.chunks if chunk.start > raw.chunks[0].start + 2.0]
    off = (errors(late) + 0.5) % 1.0 - 0.5
    assert np.abs(off).max() < 0.0135
    nodes.end(driver)
    nodes.end(device)
    raw.close()


@pytest.mark.parametrize(
    ("name", "argument", "words"),
    [
        ("emg", "_envelope:={lowpas: 6}", "no parameter 'lowpas' in /wrong/envelope; valid:"),
        ("emulated_emg", "_muscles:=[a, a]", "64 names, all different"),
    ],
)
def test_a_wrong_parameter_ends_a_node_with_one_line(
    ros: str, nodes: Nodes, name: str, argument: str, words: str
) -> None:
    process = nodes.start(name, "__name:=wrong", argument)
    output = process.communicate(timeout=LIMIT)[0]
    assert process.returncode == 2 and words in output and "Traceback" not in output
