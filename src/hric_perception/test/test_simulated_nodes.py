"""The nodes `emulated_human`, `emulated_plate` and `emulated_emg` as processes that measure a simulated human."""

import os
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import sweeping_muscles
import yaml
from geometry_msgs.msg import PoseStamped
from moving_body import BODY, PERIOD, PERSON, Oracle, joint_state
from real_master import free_port, ros, roscore
from sensor_msgs.msg import JointState
from sensor_nodes import Diagnosis, Nodes, TellsTime, TopicActivation, nodes, run, wait

from hric_msgs.msg import MocapData, MuscleActivation
from hric_perception.emg.envelope import EnvelopeSettings, lag

__all__ = ["nodes", "ros", "roscore", "run"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
CLIENT = "../../mocap_natnet/nodes/natnet_client"
PERSON_ARGUMENT = f"_person:={yaml.safe_dump(PERSON, default_flow_style=True, width=1000).strip()}"
SWEEP = 4.0
"""Time of one sweep of the person's activation, up and down [s]."""
LATE = 0.03
"""Delay of the person's messages [s]."""


class Moves:
    """Publisher of the simulated person's messages, with a delay.

    Args:
        run: clock of robot time.
        topic: name of the topic below `hric/human`.
        kind: type of the messages.
        made: function from a time [s] to the message.
    """

    def __init__(self, run: TellsTime, topic: str, kind: type, made: Callable[[float], Any]) -> None:
        import rospy

        self._run, self._made, self._stop = run, made, threading.Event()
        self._publisher = rospy.Publisher(f"/hric/human/{topic}", kind, queue_size=100)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        due = round(self._run.time / PERIOD)
        while not self._stop.wait(PERIOD):
            while due * PERIOD <= self._run.time - LATE:
                self._publisher.publish(self._made(due * PERIOD))
                due += 1

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._publisher.unregister()


@pytest.fixture
def moves(run: TellsTime) -> Iterator[Moves]:
    made = Moves(run, "joint_states", JointState, joint_state)
    yield made
    made.close()


@pytest.fixture
def contracts(run: TellsTime) -> Iterator[Moves]:
    made = Moves(run, "activation", MuscleActivation, lambda time: sweeping_muscles.message(time, SWEEP))
    yield made
    made.close()


def listen(topic: str, kind: type) -> list[Any]:
    import rospy

    seen: list[Any] = []
    rospy.Subscriber(topic, kind, seen.append, queue_size=None)
    return seen


def test_the_client_sees_the_markers_where_they_were_at_the_stamps_of_the_frames(moves: Moves, nodes: Nodes) -> None:
    frames, truth = listen("/hric/perception/mocap", MocapData), listen("/hric/human/hand", PoseStamped)
    ports = {"command_port": free_port(), "data_port": free_port()}
    stream = yaml.safe_dump({"transport": "unicast", "rate": 120, **ports}, default_flow_style=True).strip()
    nodes.start("emulated_human", "_human:={program: body}", f"_stream:={stream}", PERSON_ARGUMENT)
    client = [f"_{name}:={port}" for name, port in ports.items()]
    nodes.start(CLIENT, "__name:=natnet_client", *client, "_local:=127.0.0.1", "_base_frame:=panda_link0")
    wait(lambda: len(frames) > 240 and frames[-1].latency > 0.0 and len(truth) > 200)
    oracle, hand = Oracle(), BODY.segments["right_hand"]
    settled = [message for message in frames if message.latency > 0.0][-100:]
    assert all(message.latency > LATE for message in settled), "nobody saw the person before their message came"
    for message in settled[::10]:
        at = message.header.stamp.to_sec()
        named = dict(zip(message.labelled_marker_names, message.labelled_markers, strict=True))
        for name, marker in BODY.markers.items():
            expected = oracle.point(at, marker.link, marker.p_link_marker)
            p = named[f"body/{name}"]
            # At up to 2 m/s a stamp that is wrong by 1 ms is 2 mm.
            assert np.linalg.norm(np.array([p.x, p.y, p.z]) - expected) < 2e-3, name
    for message in truth[-100::10]:
        expected = oracle.point(message.header.stamp.to_sec(), hand.link, hand.mass.com)
        p = message.pose.position
        assert [p.x, p.y, p.z] == pytest.approx(expected.tolist(), abs=1e-6)


def test_the_plate_sends_what_they_pressed_with_at_the_time_of_each_sample(moves: Moves, nodes: Nodes) -> None:
    session = f"test_body_{os.getpid()}"
    samples = TopicActivation("/hric/perception/force_plate/1/samples")
    where = "_pose:={xyz: [0.9, 0.1, -0.75]}"
    device = nodes.start(
        "emulated_plate",
        f"_session:={session}",
        "_load:={program: body}",
        PERSON_ARGUMENT,
        where,
        "_faults:={time_code: true}",
    )
    driver = nodes.start("force_plate", f"_lsl:={{session: {session}}}")
    wait(lambda: samples.chunks and samples.end > samples.chunks[0].start + 2.5)
    assert "Traceback" not in nodes.end(device) + nodes.end(driver)
    samples.close()
    rows = np.concatenate([chunk.data for chunk in samples.chunks])
    numbers = np.rint(1000.0 * rows[:, -1])
    assert (np.diff(numbers) == 1).all(), "what waits is not lost"
    oracle, weight = Oracle(), (BODY.subject.mass - BODY.total_mass) * np.array([0.0, 0.0, -9.81])
    p = np.array([0.9, 0.1, -0.75])
    for row in rows[500::100]:
        force, torque = oracle.pressed(float(row[-1]))
        total = force + weight
        moved = torque + np.cross(oracle.root.position, weight) - np.cross(p, total)
        # Straight lines between messages: (w h)^2 / 8 of what changes, here of some 30 N.
        assert row[:6] == pytest.approx([*total, *moved], abs=1e-2)


def test_the_envelope_over_lsl_follows_their_activation_and_no_sample_is_lost(
    contracts: Moves, nodes: Nodes, figure: Callable[[str, float, str], None]
) -> None:
    session = f"test_muscles_{os.getpid()}"
    raw, smooth = (TopicActivation(f"/hric/perception/emg/{name}") for name in ("raw", "envelope"))
    device = nodes.start(
        "emulated_emg", f"_session:={session}", "_activation:={program: topic}", "_faults:={time_code: true}"
    )
    driver = nodes.start("emg", f"_lsl:={{session: {session}}}")
    wait(lambda: smooth.chunks and smooth.end > smooth.chunks[0].start + 1.5 * SWEEP)
    assert "Traceback" not in nodes.end(device) + nodes.end(driver)
    raw.close()
    smooth.close()
    codes = np.rint(2000.0 * np.concatenate([chunk.data[:, -1] for chunk in raw.chunks]))
    assert (np.diff(codes) == 1).all(), "what waits is not lost"
    times = np.concatenate([chunk.times for chunk in smooth.chunks])
    values = np.concatenate([chunk.data for chunk in smooth.chunks])
    kept, late = times > times[0] + 0.5, lag(EnvelopeSettings(), 2000.0)
    found = sweeping_muscles.correlations(sweeping_muscles.PHASES, times[kept], values[kept], SWEEP, late)
    figure("lag of the EMG envelope, over LSL", 1e3 * late, "ms")
    figure("EMG envelope over LSL against activation from 0.05 to 0.4, least correlation", min(found), "1")
    assert min(found) >= 0.95


def test_a_plate_that_measures_nobody_says_so_and_sends_nothing(run: TellsTime, nodes: Nodes) -> None:
    process = nodes.start("emulated_plate", "__name:=wrong", "_load:={program: body}")
    output = process.communicate(timeout=30)[0]
    assert process.returncode == 2
    assert "/wrong/person is not set, but {program: body} measures a simulated human" in output
    said = Diagnosis("emulated_plate")
    nodes.start("emulated_plate", f"_session:=nobody_{os.getpid()}", "_load:={program: body}", PERSON_ARGUMENT)
    wait(lambda: said.says("waiting for the first message about the simulated human"))
