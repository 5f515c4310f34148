"""A recorded trial live: the emulated human starts, and markers, EMG and force plate are those of the trial at one
time."""

import os
from pathlib import Path

import c3d_files
import numpy as np
import pytest
from c3d_files import PER_FRAME, RATE, Lab
from real_master import free_port, ros, roscore
from sensor_nodes import Nodes, TellsTime, TopicActivation, nodes, run, wait

__all__ = ["nodes", "ros", "roscore", "run"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
FRAMES = 100


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    t = np.arange(FRAMES * PER_FRAME) / (RATE * PER_FRAME)
    wrench = np.column_stack([0 * t, 0 * t, -500 - 100 * t, 0 * t, 0 * t, 0 * t])
    lab = Lab(c3d_files.swinging(FRAMES)[0], {"EMG1": ("mV", 1 + t)}, [(2, wrench)])
    return c3d_files.write(tmp_path_factory.mktemp("c3d") / "trial.c3d", lab)


def test_markers_emg_and_plate_of_a_trial_begin_together(run: TellsTime, nodes: Nodes, file: Path) -> None:
    import rospy
    from geometry_msgs.msg import PoseStamped
    from std_msgs.msg import Header
    from std_srvs.srv import Trigger

    session, begins, hand = f"test_trial_{os.getpid()}", list[Header](), list[PoseStamped]()
    emg, plate = TopicActivation("/hric/perception/emg/raw"), TopicActivation("/hric/perception/force_plate/1/samples")
    subscribers = [
        rospy.Subscriber("/hric/human/start", Header, begins.append),
        rospy.Subscriber("/hric/human/hand", PoseStamped, hand.append, queue_size=None),
    ]
    stream = f"_stream:={{command_port: {free_port()}, data_port: {free_port()}}}"
    nodes.start("emulated_human", f"_human:={{program: c3d, path: {file}}}", stream)
    nodes.start(
        "emulated_emg",
        f"_session:={session}",
        "_muscles:=[biceps]",
        f"_activation:={{program: c3d, path: {file}, channels: [EMG1]}}",
    )
    nodes.start("emg", f"_lsl:={{session: {session}, name: emulated_emg}}")
    nodes.start("emulated_plate", f"_session:={session}", f"_load:={{program: c3d, path: {file}}}")
    nodes.start("force_plate", f"_lsl:={{session: {session}, name: emulated_plate}}")
    wait(lambda: emg.chunks and plate.chunks)
    rospy.wait_for_service("/emulated_human/start", 20)
    wait(lambda: rospy.ServiceProxy("/emulated_human/start", Trigger)().success)
    wait(lambda: begins and min(emg.end, plate.end) > begins[0].stamp.to_sec() + FRAMES / RATE + 0.1)
    for subscriber in subscribers:
        subscriber.unregister()
    emg.close()
    plate.close()
    begin = begins[0].stamp.to_sec()
    for heard, column, slope, start in ((emg, 0, 1e-3, 1e-3), (plate, 2, -100.0, -500.0)):
        times = np.concatenate([chunk.times for chunk in heard.chunks])
        values = np.concatenate([chunk.data[:, column] for chunk in heard.chunks])
        inside = (times > begin + 0.001) & (times < begin + (FRAMES - 2) / RATE)
        assert inside.sum() > 800
        assert np.abs((values[inside] - start) / slope - (times[inside] - begin)).max() < 1e-3  # [s]
    exact = c3d_files.swinging(FRAMES)[1]
    moving = [message for message in hand if begin < message.header.stamp.to_sec() < begin + (FRAMES - 2) / RATE]
    assert len(moving) > 50
    for message in moving:
        place = (message.header.stamp.to_sec() - begin) * RATE
        p = message.pose.position
        assert [p.x, p.y, p.z] == pytest.approx(
            [np.interp(place, np.arange(FRAMES), column) for column in exact.T], abs=1e-4
        )
