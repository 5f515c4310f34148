"""Control log, setpoints and times as read from the bag of a synthetic run with known numbers."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from weakref import ref

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray, String
from synthetic import JOINTS, log_message, signals, write_run

from hric_bags import reader as bag_reader
from hric_bags.memory import MemoryBag
from hric_bags.reader import BagError
from hric_core.robot_time.stamps import to_time
from hric_run.bag_writer import BagWriter


def test_the_control_log_comes_back_bit_for_bit(tmp_path: Path) -> None:
    record = bag_reader.read(write_run(tmp_path).bag_path)
    time, position, velocity = signals(2000, 0.1)
    assert record.log.joint_names == JOINTS
    assert np.array_equal(record.log.time, time)
    assert np.array_equal(record.log.position, position)
    assert np.array_equal(record.log.velocity, velocity)
    assert (record.log.gaps, record.log.repeats, record.log.first_cycle) == ((), (), 0)
    assert record.topics == {"/control_log": 100, "/pd/command": 1, "/pd/state": 1, "/limit_counts": 1}


def test_missing_and_repeated_cycles_are_found_and_each_cycle_is_kept_once(tmp_path: Path) -> None:
    log = bag_reader.read(write_run(tmp_path, lost=(0, 50, 51), twice=(70,)).bag_path).log
    assert log.first_cycle == 20
    assert log.gaps == ((1000, 40),)
    assert log.repeats == ((1400, 20),)
    assert log.cycles == 2000 - 60
    assert (np.diff(log.time) > 0).all()


def test_an_overlapping_batch_adds_only_its_new_cycles() -> None:
    data = signals(100, 0.0)
    log = bag_reader.stitch([log_message(0, 20, data), log_message(10, 20, data), log_message(30, 10, data)])
    assert (log.cycles, log.repeats, log.gaps) == (40, ((10, 10),), ())


def test_a_message_of_the_control_log_without_some_of_its_values_is_refused() -> None:
    message = log_message(0, 20, signals(100, 0.0))
    message.velocity = message.velocity[:-1]
    with pytest.raises(BagError, match=r"59 values of velocity; valid: 60"):
        bag_reader.stitch([message])


class Watched(SimpleNamespace):
    """Message of which tests can see when it is deleted."""


def test_of_the_messages_of_a_control_log_none_is_kept_but_the_last() -> None:
    data, references, most = signals(400, 0.0), list[ref[Watched]](), 0

    def messages() -> Iterator[Watched]:
        nonlocal most
        for first in range(0, 400, 20):
            log = log_message(first, 20, data)
            message = Watched(**{name: getattr(log, name) for name in log.__slots__})
            references.append(ref(message))
            most = max(most, sum(reference() is not None for reference in references))
            yield message
            del message

    assert bag_reader.stitch(messages()).cycles == 400
    assert most <= 2


def test_a_record_of_a_run_so_far_stays_as_it_is_while_the_run_goes_on() -> None:
    data, messages, bag = signals(100, 0.0), bag_reader.RunMessages(), MemoryBag()
    messages.add("/control_log", bag_reader.LOG_TYPE, 0, log_message(0, 20, data))
    early = messages.record(bag).log
    before = early.state_sha256()
    for first in (20, 40, 60, 80):
        messages.add("/control_log", bag_reader.LOG_TYPE, 0, log_message(first, 20, data))
    assert (early.cycles, early.state_sha256()) == (20, before)
    assert messages.record(bag).log.cycles == 100


@pytest.mark.parametrize("pace", [1.0, 0.7])
def test_stamps_become_robot_time_also_where_the_robots_clock_runs_slower_than_the_stamps(
    tmp_path: Path, pace: float
) -> None:
    begin, data = 1.7e9, signals(2000, 1.0)
    path = tmp_path / "slow.bag"
    with BagWriter(path) as bag:
        for first in range(0, 2000, 20):
            message = log_message(first, 20, data)
            stamp = begin + first * 1e-3 / pace
            message.header.stamp = to_time(stamp)
            bag.write("/control_log", message, stamp)
            if first == 1000:
                bag.write("/pd/command", Float64MultiArray(data=[0.0] * 3), stamp)
    assert bag_reader.read(path).setpoints[0].time == pytest.approx(1.0, abs=1e-5)


def test_the_hash_changes_with_a_single_bit() -> None:
    data = signals(20, 0.0)
    first, second = (bag_reader.stitch([log_message(0, 20, data)]) for _ in range(2))
    assert first.state_sha256() == second.state_sha256()
    second.velocity[7, 1] = np.nextafter(second.velocity[7, 1], 1.0)
    assert first.state_sha256() != second.state_sha256()


def test_a_bag_that_is_missing_unfinished_or_without_log_is_reported(tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"no bag a\.bag"):
        bag_reader.read(tmp_path / "a.bag")
    (tmp_path / "a.bag.active").write_bytes(b"")
    with pytest.raises(BagError, match=r"health --salvage .*a\.bag\.active"):
        bag_reader.read(tmp_path / "a.bag")
    with BagWriter(tmp_path / "b.bag") as bag:
        bag.write("/text", String("x"), 0.0)
    with pytest.raises(BagError, match="no control log; topics: /text"):
        bag_reader.read(tmp_path / "b.bag")
    (tmp_path / "c.bag").write_bytes(b"no bag")
    with pytest.raises(BagError, match=r"cannot read c\.bag"):
        bag_reader.read(tmp_path / "c.bag")
