"""Force plates: wrench, centre of pressure, frame; samples by NatNet and by contacts of a simulation."""

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from real_master import free_port

from hric_core.errors import HricError, ParameterError
from hric_core.geometry import Pose, from_rotation_vector, transformed
from hric_core.geometry.poses import from_z_up
from hric_core.robot_time.stream_time import WallClock
from hric_perception.chunk import Chunk, Layout
from hric_perception.emulation import Faults
from hric_perception.plate.geometry import (
    CHANNELS,
    UNITS,
    at_surface,
    centre_of_pressure,
    choose_channels,
    frame_of,
    mean_wrench,
    wrench_at,
)
from hric_perception.plate.loads import PROGRAM, ContactLoad
from hric_perception.plate.natnet import NatNetPlate, PlateMotive, PlateStream
from hric_perception.stream import ERROR, OK, SampleStream, StreamHealth
from mocap_natnet.client import ClientSettings

pytestmark = pytest.mark.alone

LIMIT = 30.0
LAYOUT = Layout("test", CHANNELS, UNITS, 1000.0)


def read_load(content):
    return PROGRAM.checked(content, "load").load()


def wait(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


@pytest.mark.parametrize("point", [(0.1, -0.05, 0.0), (-0.25, 0.15, 0.0)])
def test_the_centre_of_pressure_is_where_the_force_acts_whatever_lies_between_surface_and_origin(
    point: tuple[float, float, float],
) -> None:
    force = (30.0, -20.0, -700.0)
    height = 0.04
    told = wrench_at((point[0], point[1], height), force)  # about an origin below the surface
    found = centre_of_pressure(at_surface(told, height))
    assert found == pytest.approx(point)
    # Facts of practice: px = (pz Fx - My) / Fz, py = (Mx + pz Fy) / Fz
    fx, fy, fz, mx, my, _ = told
    assert found[:2] == pytest.approx(((height * fx - my) / fz, (mx + height * fy) / fz))


def test_there_is_no_centre_of_pressure_up_to_twenty_newtons() -> None:
    assert centre_of_pressure(wrench_at((0.1, 0.0, 0.0), (0.0, 0.0, -20.0))) is None
    assert centre_of_pressure(wrench_at((0.1, 0.0, 0.0), (0.0, 0.0, -20.1))) is not None


def test_a_mean_leaves_out_what_is_not_finite() -> None:
    data = np.arange(60.0).reshape(10, 6)
    data[3, 2] = np.nan
    found = mean_wrench(Chunk(LAYOUT, 5.0, 0, data))
    assert (
        found is not None
        and found[0] == pytest.approx(5.0 + (45 - 3) / 9 / 1000)
        and found[1][0] == pytest.approx((270 - 18) / 9)
    )
    assert mean_wrench(Chunk(LAYOUT, 5.0, 0, data * np.nan)) is None


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0, math.pi, -2.5])
def test_the_frame_of_a_plate_is_that_of_its_corners(up: str, angle: float) -> None:
    T = Pose((1.0, 2.0, 0.1), from_rotation_vector((0.05, -0.1, angle)))
    corners = [
        from_z_up(up, transformed(T, (dx, dy, 0.0))) for dx, dy in ((0.3, 0.2), (0.3, -0.2), (-0.3, -0.2), (-0.3, 0.2))
    ]
    found = frame_of(corners, up)
    for point in ((0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.1, 0.3)):
        assert transformed(found, point) == pytest.approx(transformed(T, point), abs=1e-9)


def test_corners_that_span_nothing_are_refused() -> None:
    with pytest.raises(ParameterError, match="corners"):
        frame_of([(0.0, 0.0, 0.0)] * 4, "z")


def test_channels_are_found_in_any_case_and_a_missing_one_is_named() -> None:
    found = choose_channels(
        Layout("x", ("fx", "FY", "Fz", "Mx", "my", "mz", "time"), ("",) * 6 + ("s",), 1000.0), "plate"
    )
    assert found.channels == (*CHANNELS, "time") and found.units == (*UNITS, "s") and found.frame == "plate"
    with pytest.raises(ParameterError, match="has no channel Mz, only Fx, Fy"):
        choose_channels(Layout("x", CHANNELS[:5], UNITS[:5], 1000.0), "plate")


def test_contacts_of_a_simulation_load_the_plate_in_its_own_frame() -> None:
    T = Pose((0.5, 0.1, 0.05), from_rotation_vector((0.0, 0.0, math.pi / 2)))
    load = ContactLoad("plate", T)
    load.add(1.0, [])
    point, force = (0.5, 0.2, 0.05), (0.0, 0.0, -50.0)
    on_plate = ("plate::link", "panda::panda_hand", [(point, force)])
    by_arm = ("panda::panda_hand", "plate::link", [(point, (0.0, 0.0, 50.0))])
    load.add(2.0, [on_plate, ("plates::link", "panda::x", [(point, force)])])
    load.add(2.01, [by_arm, by_arm])
    load.add(2.02, [])
    wrench = load(np.array([1.5, 1.989, 2.0, 2.01, 2.015, 2.5]))
    assert wrench[:, 2] == pytest.approx([0, 0, -50, -100, -50, 0])
    assert centre_of_pressure(wrench[2]) == pytest.approx((0.1, 0.0, 0.0))


def test_a_push_is_a_swell_at_its_point() -> None:
    load = read_load({"program": "push", "force": 80, "point": [0.1, -0.1], "period": 2})
    wrench = load(np.array([0.0, 1.0]))
    assert wrench[0] == pytest.approx(np.zeros(6)) and centre_of_pressure(wrench[1]) == pytest.approx((0.1, -0.1, 0.0))
    with pytest.raises(HricError, match="no program 'jump' in load; valid: body, c3d, constant, contacts, push"):
        read_load({"program": "jump"})


def test_the_world_with_a_plate_has_it_where_the_page_says() -> None:
    world = yaml.safe_load((Path(__file__).parents[1] / "worlds" / "force_plate.yaml").read_text())
    (plate,) = world["objects"]
    assert plate["name"] == "plate" and plate["pose"]["xyz"][2] + plate["size"][2] / 2 == pytest.approx(0.05)


class Rig:
    """A plate over NatNet on loopback."""

    def __init__(self, loss: float = 0.0, plate: int = 0) -> None:
        ports = {"command_port": free_port(), "data_port": free_port()}
        self.section = {"rate": 200, "loss": loss, **ports}
        self.chunks: list[Chunk] = []
        self.described: list[object] = []
        self.health = StreamHealth("natnet")
        stream = SampleStream(lambda monotonic: 1e-9 * monotonic, self.health, self.chunks.append)
        self.reader = NatNetPlate(
            ClientSettings(**ports), plate, stream, self.health, lambda layout: layout, self.described.append
        )
        self.reader.start()

    def motive(self) -> PlateMotive:
        load = read_load({"program": "constant", "wrench": [1, 2, -300, 4, 5, 6]})
        return PlateMotive(PlateStream.of(self.section, "natnet"), 1000.0, load, Faults(time_code=True), WallClock())


@pytest.fixture
def rigs() -> Iterator[Callable[..., Rig]]:
    made: list[Rig] = []

    def make(**given: float) -> Rig:
        made.append(Rig(**given))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for rig in made:
        rig.reader.close()


def test_samples_within_frames_get_the_times_at_which_they_were_taken_and_lost_frames_show(
    rigs: Callable[..., Rig],
) -> None:
    rig = rigs(loss=0.02)
    motive = rig.motive()
    wait(lambda: rig.health.samples > 2500)
    motive.close()
    data = np.concatenate([chunk.data for chunk in rig.chunks])
    assert (data[:, :5] == [1, 2, -300, 4, 5]).all()
    times = np.concatenate([chunk.times for chunk in rig.chunks])
    off = (times - data[:, 5] + 0.5) % 1.0 - 0.5
    assert np.abs(off[500:]).max() < 5e-4
    numbers = np.concatenate([np.arange(chunk.first, chunk.after) for chunk in rig.chunks])
    steps = np.diff(numbers[500:])
    assert set(steps.tolist()) <= {1, 6, 11, 16} and rig.health.lost > 0
    assert np.abs(np.diff(times[500:]) - steps / 1000.0).max() < 5e-4
    assert rig.described and rig.chunks[0].layout.rate == pytest.approx(1000.0)


def test_a_plate_that_is_not_there_and_a_server_that_dies_and_returns_are_reported(rigs: Callable[..., Rig]) -> None:
    other, rig = rigs(plate=7), rigs()
    assert "waiting" in rig.health.report().text
    other_motive, motive = other.motive(), rig.motive()
    wait(lambda: rig.health.report().level == OK)
    wait(lambda: "no force plate 7 in the NatNet stream; valid: 1" in other.health.report().text)
    motive.close()
    wait(lambda: rig.health.report().level == ERROR)
    before = rig.health.samples
    motive = rig.motive()
    wait(lambda: rig.health.samples > before + 200)
    motive.close()
    other_motive.close()


def test_a_rate_that_is_no_multiple_of_the_frames_is_refused() -> None:
    with pytest.raises(
        ParameterError,
        match=r"natnet\.rate is 240.0; valid: a frame rate that divides the plate's 1000 Hz without remainder",
    ):
        PlateMotive(
            PlateStream.of({"rate": 240, "command_port": 0}, "natnet"),
            1000.0,
            lambda times: times,
            Faults(),
            WallClock(),
        )
