"""Recording of a simulated human who guides the robot's hand, with motion capture and a force plate.

Robot, grip, motion capture and plate are in one bag, and synchronised.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bags import control_log, gaps_and_repeats
from live_system import LiveSystem
from rosbags.highlevel import AnyReader
from test_data_collection import ran

pytestmark = pytest.mark.alone

Start = Callable[..., LiveSystem]
Figure = Callable[[str, float, str], None]
FRAMES, PLATE, GRIP, JOINTS = (
    "/hric/perception/mocap",
    "/hric/perception/force_plate/1/samples",
    "/hric/human/grip",
    "/hric/human/joint_states",
)
FRAME_RATE, PLATE_RATE, HUMAN_RATE = 120.0, 1000.0, 200.0
SKEW = 2e-4
"""Required limit of the error of stamps [s]."""
WEIGHT = 78.2 * 9.81
"""Weight of the subject [N]."""


def messages(bag: Path, topic: str) -> list[Any]:
    """Return the messages of a topic, in order."""
    with AnyReader([bag]) as reader:
        chosen = [item for item in reader.connections if item.topic == topic]
        return [reader.deserialize(raw, item.msgtype) for item, _, raw in reader.messages(chosen)]


def stamp(message: Any) -> float:
    return float(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)


def check_counts(system: LiveSystem, metrics: dict[str, Any]) -> tuple[float, float]:
    """Check that all sent samples are in the bag, without gaps over the whole interval by the devices' own numbers.

    Returns:
        start and end of the interval [s].
    """
    begin, end = yaml.safe_load((system.run_folder / "run.yaml").read_text())["interval"]
    bag = bag_of(system)
    assert gaps_and_repeats(control_log(bag)[0]) == (0, 0)
    for topic, values in metrics["sources"].items():
        assert (values["sent"], values["lost"], values["twice"]) == (values["recorded"], 0, 0), topic
    numbers, grid, _ = frames_of(bag)
    assert set(np.diff(numbers[within(grid, begin, end)])) == {1}
    assert within(grid, begin, end).sum() == pytest.approx(FRAME_RATE * (end - begin), abs=1.5)
    codes, _, _ = samples_of(bag)
    assert set(np.diff(np.rint(codes[within(codes, begin, end)] * PLATE_RATE))) == {1.0}
    assert within(codes, begin, end).sum() == pytest.approx(PLATE_RATE * (end - begin), abs=1.5)
    return begin, end


def check_stamps(bag: Path, begin: float, end: float, figure: Figure, what: str) -> None:
    """Check that frames and samples have the stamps of their numbers and time codes, and the person those of cycles."""
    _, grid, times = frames_of(bag)
    inside = within(grid, begin, end)
    on_grid(f"{what}, frames", times[inside], grid[inside], figure)
    codes, times, _ = samples_of(bag)
    inside = within(codes, begin, end)
    assert np.abs(codes * PLATE_RATE - np.rint(codes * PLATE_RATE)).max() < 1e-6
    on_grid(f"{what}, samples of the plate", times[inside], codes[inside], figure)
    for topic in (GRIP, JOINTS):
        times = np.array([stamp(message) for message in messages(bag, topic)])
        times = times[within(times, begin, end)]
        assert np.abs(times * HUMAN_RATE - np.rint(times * HUMAN_RATE)).max() < 1e-3
        figure(f"{what}, {topic}: missing", round(HUMAN_RATE * (end - begin)) + 1 - len(times), "messages")


def bag_of(system: LiveSystem) -> Path:
    return next(system.run_folder.glob("*.bag"))


def within(times: np.ndarray, begin: float, end: float) -> np.ndarray:
    inside: np.ndarray = (times >= begin - 1e-6) & (times <= end + 1e-6)
    return inside


def frames_of(bag: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the numbers of the frames, their expected times by these numbers [s], and their stamps [s]."""
    frames = messages(bag, FRAMES)
    numbers, times = np.array([m.frame_number for m in frames]), np.array([stamp(m) for m in frames])
    return numbers, np.median(times - numbers / FRAME_RATE) + numbers / FRAME_RATE, times


def samples_of(bag: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time codes [s], stamps [s] and vertical loads [N] of the plate's samples."""
    chunks = messages(bag, PLATE)
    rows = np.concatenate([chunk.data.reshape(-1, len(chunk.channels)) for chunk in chunks])
    times = [stamp(c) + np.arange(len(c.data) // len(c.channels)) / c.rate for c in chunks]
    names = chunks[0].channels
    return rows[:, names.index("time")], np.concatenate(times), rows[:, names.index("Fz")]


def missed_deadlines(bag: Path) -> int:
    """Return the number of missed deadlines that the control loop reports at its end."""
    values = [
        value for message in messages(bag, "/diagnostics") for status in message.status for value in status.values
    ]
    return int([value.value for value in values if value.key == "missed deadlines"][-1])


def on_grid(what: str, times: np.ndarray, grid: np.ndarray, figure: Figure) -> None:
    """Check that 99 % of the stamps are within SKEW of their expected times; a busy machine delays single ones."""
    away = np.abs(times - grid)
    figure(f"{what}: stamps off their grid, 99 %", 1e3 * float(np.quantile(away, 0.99)), "ms")
    figure(f"{what}: stamps off their grid, largest", 1e3 * float(away.max()), "ms")
    assert np.quantile(away, 0.99) <= SKEW


def check_sync(metrics: dict[str, Any], figure: Figure, what: str) -> None:
    """Check that no synchronised sample is missing, and that the skew of its values is within the limit."""
    for topic, stream in metrics["sync"].items():
        assert stream["missing"] == 0, topic
        for source, values in stream["sources"].items():
            figure(f"{what}, {topic}, {source}: skew, 99 %", 1e3 * values["skew"]["p99"], "ms")
            assert values["skew"]["p99"] <= SKEW + values["skew"].get("uncertainty", 0.0), (topic, source, values)


@pytest.mark.live
@pytest.mark.parametrize("pace", [0.25, 1.0])
def test_motion_capture_plate_robot_and_grip_are_in_one_bag_at_common_instants(
    start: Start, figure: Figure, pace: float
) -> None:
    system = start(
        "env:=sim",
        "rviz:=false",
        "experiment:=guided_collection",
        "mocap_server:=127.0.7.13",
        f"real_time_factor:={pace}",
    )
    metrics = ran(system, 60.0 + 20.0 / pace)
    what, bag = f"guided collection at {pace:g} times real time", bag_of(system)
    figure(f"{what}: robot time per wall time", metrics["real_time_factor"], "1")
    figure(f"{what}: missed deadlines", missed_deadlines(bag), "1")
    begin, end = check_counts(system, metrics)
    # The load on the plate is the person's weight, plus or minus the force between person and robot.
    assert samples_of(bag)[2].mean() == pytest.approx(-WEIGHT, rel=0.05)
    assert any(message.closed for message in messages(bag, GRIP))
    check_stamps(bag, begin, end, figure, what)
    check_sync(metrics, figure, what)
