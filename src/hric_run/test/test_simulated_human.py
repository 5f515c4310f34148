"""An experiment whose cameras and plate measure the human in the robot's plant."""

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped, PoseStamped

from hric_core.geometry import from_rotation_vector
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings
from hric_msgs.msg import MocapData
from hric_run.definition import experiment, overrides, parameters
from hric_run.definition.experiment import Experiment, ExperimentError
from hric_run.simulation import Simulation

MOVES = "human.control.parameters.reference.points:=[[0.1, 0.42, 0, 0.55], [0.5, 0.42, 0.1, 0.55]]"


def raw(*given: str, without: tuple[str, ...] = ()) -> dict[str, Any]:
    content = overrides.apply(experiment.read("guided_collection"), given)
    return {key: value for key, value in content.items() if key not in without}


def headless(*given: str) -> Experiment:
    """The experiment without the sections that need a network."""
    return experiment.parse("guided", raw("duration:=0.8", MOVES, *given, without=("force_plate", "sync")))


def measured(run: Experiment, seed: int) -> dict[str, list[Any]]:
    """Messages of a run by topic, and the positions of the person's wrist in the plant by milliseconds."""
    found: dict[str, list[Any]] = {"wrist": []}
    with Simulation(run, seed=seed) as simulation:
        for topic, kind in (
            ("hric/perception/mocap", MocapData),
            ("hric/human/hand", PoseStamped),
            ("mocap/marker_stamped", PointStamped),
        ):
            simulation.node.subscribe(topic, kind, found.setdefault(topic, []).append)
        plant: Any = simulation.app.hw.plant  # type: ignore[attr-defined]
        for _ in range(800):
            found["wrist"].append(plant.link_state("human::r_wrist")[0].copy())
            simulation.run(0.001)
    return found


def test_the_cameras_see_the_hand_where_the_plant_has_it_and_the_followed_marker_is_it() -> None:
    run = headless("mocap.stream.noise:=0")
    found = measured(run, 1)
    frames = found["hric/perception/mocap"]
    assert [message.frame_number for message in frames] == list(range(len(frames))) and len(frames) > 0.78 * 120
    com = describe(HumanSettings.of(run.human, "human").person).segments["right_hand"].mass.com
    truth = {round(message.header.stamp.to_sec(), 3): message.pose.position for message in found["hric/human/hand"]}
    for millisecond in (100, 300, 400, 700):
        T = found["wrist"][millisecond]
        p = truth[millisecond / 1000.0]
        # The person's message has the joints before the step of its cycle.
        assert [p.x, p.y, p.z] == pytest.approx((T @ [*com, 1.0])[:3].tolist(), abs=2e-4)
    for marker, frame in zip(found["mocap/marker_stamped"], frames, strict=True):
        assert marker.header.stamp == frame.header.stamp
        assert marker.point == frame.rigid_bodies[0].pose.position
    assert frames[0].labelled_marker_names[-1].startswith("body/")


def test_the_same_seed_gives_the_same_frames() -> None:
    first, again, other = (
        [str(message) for message in measured(headless(), seed)["hric/perception/mocap"]] for seed in (1, 1, 2)
    )
    assert first == again and first != other


@pytest.mark.parametrize(
    ("without", "said"),
    [
        (
            ("human", "force_plate"),
            r"mocap\.human\.program is body, but there is no human in the robot's plant; valid: a section",
        ),
        (("human", "mocap"), r"force_plate\.emulated\.load\.program is body, but there is no human in the robot"),
    ],
)
def test_a_device_that_measures_nobody_is_refused(without: tuple[str, ...], said: str) -> None:
    with pytest.raises(ExperimentError, match=said):
        experiment.parse("guided", raw(without=without))


def test_the_nodes_get_who_the_person_is_and_where_from_the_section_human() -> None:
    given = ("human.position:=[1.0, 0.5]", "human.parts:=both_arms")
    content = raw(*given)
    content["robot"]["description"] |= {"xyz": "0.1 -0.2 0.3", "rpy": "0 0 0.5"}
    definition = experiment.parse("guided", content)
    seeing, carrying = parameters.mocap(definition)["emulated_human"], parameters.sensors(definition)["emulated_plate"]
    assert seeing["person"] == carrying["person"]
    person = HumanSettings.of(seeing["person"], "person")
    assert (person.position, person.parts, person.floor) == ((1.0, 0.5), "both_arms", -0.75)
    base = seeing["world_from_base"]
    assert base["xyz"] == [0.1, -0.2, 0.3]
    expected = rotation_from_quaternion(from_rotation_vector((0.0, 0.0, 0.5)))
    np.testing.assert_allclose(rotation_from_quaternion(base["xyzw"]), expected, atol=1e-12)
    content["robot"]["description"]["rpy"] = "up"
    with pytest.raises(ExperimentError, match=r"robot\.description\.rpy is 'up'; valid: three numbers"):
        parameters.mocap(experiment.parse("guided", content))
    assert definition.force_plate is not None
    assert definition.force_plate.record()["computed"] == "load: from the simulated body's motion"
