"""Collection of numbers from messages in arrays."""

from types import SimpleNamespace

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from hric_bags.memory import MemoryBag
from hric_bags.records import human_record
from hric_bags.records.rows import RecordRows, Thinning
from hric_core.robot_time.stamps import to_time
from hric_msgs.msg import JointTorque


def raw(milliseconds: int) -> bytes:
    """Return a header with a stamp."""
    seconds, rest = divmod(milliseconds, 1000)
    return bytes(4) + seconds.to_bytes(4, "little") + (rest * 1_000_000).to_bytes(4, "little")


@pytest.mark.parametrize("step", [5, 10], ids=["200 Hz", "100 Hz"])
def test_of_a_faster_stream_a_hundred_messages_a_second_are_kept_by_their_stamps(step: int) -> None:
    thinning = Thinning(100.0)
    kept = [stamp for stamp in range(0, 2000, step) if thinning.due("/a", raw(stamp))]
    assert kept == list(range(0, 2000, 10))


def test_a_stream_whose_clock_goes_back_is_kept() -> None:
    thinning = Thinning(100.0)
    assert [thinning.due("/a", raw(stamp)) for stamp in (1000, 1010, 500, 510)] == [True] * 4


def test_streams_are_thinned_each_by_itself() -> None:
    thinning = Thinning(100.0)
    assert all(thinning.due(stream, raw(1)) for stream in ("/a", "/b"))


def test_rows_have_the_order_of_their_times() -> None:
    rows = RecordRows("position")
    for stamp in (0.0, 0.2, 0.1):
        rows.add(stamp, SimpleNamespace(name=["elbow"], position=[10.0 * stamp]))
    time, position = rows.columns(float)
    assert time.tolist() == [0.0, 0.1, 0.2] and position[:, 0].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(("instants", "known"), [(1, False), (2, True)])
def test_one_instant_of_a_person_is_no_motion(instants: int, known: bool) -> None:
    bag = MemoryBag()
    for k in range(instants):
        header = Header(stamp=to_time(0.01 * k))
        bag.write("/hric/human/joint_states", JointState(header, ["right_el_flex"], [0.1], [0.0], [0.0]), 0.01 * k)
        load = JointTorque(header, ["right_el_flex"], [1.0], [0.1], [False], [0])
        bag.write("/hric/human/joint_torque", load, 0.01 * k)
    assert (human_record.read(bag, float) is not None) == known
