"""Human on the page of a run: position, grips and contacts."""

import json
from collections.abc import Iterator
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import rosbag
from browser import Browser, installed
from geometry_msgs.msg import Point, Vector3

from hric_bags.records import human_record
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.geometry import FloatArray, homogeneous
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_core.robot_time.stamps import to_time
from hric_human.body import describe
from hric_human.muscles.lines import ACTIVATION_COLOURS
from hric_human.participant.settings import HumanSettings
from hric_msgs.msg import RegionContact, RegionContacts
from hric_report import html as report_html
from hric_report.html import human_and_objects, run_data
from hric_skin import fitted

in_a_browser = [
    pytest.mark.slow,
    pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it"),
]
BLOW, PEAK = 0.703, 153.0
"""Contact of the forearm that begins and ends between two messages: time of the second message [s], peak force [N]."""
AT = (0.3, 0.1, 0.6)
"""Position of the contact in the world frame [m]."""
PRESSED = (0.8, 0.9)
"""Begin and end of a contact force of 40 N on the same forearm [s]."""


def write_contacts(bag: Path) -> None:
    """Write the contacts as a plant publishes them, with 200 Hz."""
    where = {"point": Point(*AT), "normal": Vector3(0.0, 0.6, -0.8)}
    forearm = {"link": "r_elbow", "regions": ["lower arm, wrist"], "kind": "penalty", "other": "world::bar", **where}
    whole = bag.with_suffix(".whole")
    with rosbag.Bag(str(bag)) as before, rosbag.Bag(str(whole), "w") as writer:
        for topic, message, time in before.read_messages(raw=True):
            writer.write(topic, message, time, raw=True)
        for time in np.arange(0.003, 1.2, 0.005):
            message = RegionContacts()
            message.header.stamp = to_time(time)
            if PRESSED[0] <= time <= PRESSED[1]:
                message.touching = [RegionContact(force=40.0, peak=40.0, **forearm)]
            message.touching += [RegionContact(link="r_wrist", kind="rigid", force=nan, peak=nan)]
            if abs(time - BLOW) < 1e-6:
                message.ended = [RegionContact(force=0.0, peak=PEAK, peak_time=BLOW - 1e-3, **forearm)]
            writer.write("/hric/human/contacts", message, message.header.stamp)
    whole.replace(bag)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    root = tmp_path_factory.mktemp("runs")
    words = ["hand_guidance", "simulator:=mujoco", "human.drive:=muscle", "duration:=1.2"]
    assert main(["run", *words, "--quiet", "--no-figures", "--runs", str(root)]) == 0
    folder = RunFolder((root / "latest").resolve())
    write_contacts(folder.bag_path)
    report_html.write(folder)
    return folder


@pytest.fixture(scope="module")
def data(run: RunFolder) -> run_data.RunData:
    return run_data.load(run, report_html.metrics_of(run))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, run: RunFolder) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as found:
        show(found, run.path)
        yield found


def show(browser: Browser, folder: Path) -> None:
    browser.open(folder / report_html.NAME)
    browser.wait("typeof report === 'object' && report.ready === true")


def transforms(data: run_data.RunData, time: float) -> dict[str, FloatArray]:
    """T_world_link of all links of the person at a time of the run [s], by pinocchio."""
    assert data.person is not None
    settings = HumanSettings.of(data.run["definition"]["human"], "human")
    body, record = describe(settings.person), data.person.record
    model = pinocchio.buildModelFromXML(body.urdf)
    state, q = model.createData(), pinocchio.neutral(model)
    for name, angle in zip(record.joints, record.position[np.argmin(np.abs(record.time - time))], strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = angle
    pinocchio.framesForwardKinematics(model, state, q)
    root = settings.root(body)
    T_world_root = homogeneous(rotation_from_quaternion(root.orientation), root.position)
    return {frame.name: T_world_root @ state.oMf[k].homogeneous for k, frame in enumerate(model.frames)}


def test_the_force_on_a_link_is_the_largest_of_an_instant_or_the_peak_of_what_has_ended(run: RunFolder) -> None:
    found = human_record.read(run.bag_path, float)
    assert found is not None
    (forearm,) = found.contacts.values()  # a rigid contact has no force
    assert (forearm.link, forearm.regions) == ("r_elbow", ("lower arm, wrist",))
    assert set(forearm.force) == {0.0, 40.0, PEAK}
    assert forearm.time[np.argmax(forearm.force)] == pytest.approx(BLOW)


def test_a_blow_between_two_instants_of_the_replay_is_not_left_out(data: run_data.RunData) -> None:
    (person,) = human_and_objects.human(data, 10.0)
    (contact,) = [arrow for arrow in person.arrows if arrow.ends]
    assert len(contact.time) < 15
    largest = np.linalg.norm(contact.force, axis=1).argmax()
    assert contact.force[largest] == pytest.approx([0.0, 0.6 * PEAK, -0.8 * PEAK])
    assert (contact.parent, contact.point[largest].tolist()) == ("world", list(AT))


def test_muscles_are_coloured_by_their_activation_and_actuators_have_no_line(data: run_data.RunData) -> None:
    (person,) = human_and_objects.human(data, 60.0)
    assert data.person is not None and data.person.record.muscles is not None and person.lines is not None
    record, lines = data.person.record.muscles, person.lines
    assert list(lines.points) == list(record.muscles) and len(lines.points) == 34
    biceps = lines.values[:, list(lines.points).index("right_bic_b")]
    expected = np.interp(lines.time, record.time, record.activation[:, record.names.index("right_bic_b")])
    np.testing.assert_allclose(biceps, expected)
    assert {link for points in lines.points.values() for link, _ in points} == {"human_base", "r_shoulder", "r_elbow"}


def test_a_run_without_muscles_has_no_lines(data: run_data.RunData) -> None:
    assert data.person is not None
    without = replace(data.person, record=replace(data.person.record, muscles=None))
    (person,) = human_and_objects.human(replace(data, person=without), 60.0)
    assert person.lines is None


def test_nobody_is_drawn_where_nobody_was(data: run_data.RunData) -> None:
    alone = replace(data, person=None)
    assert human_and_objects.human(alone, 60.0) == [] and human_and_objects.width(alone) == 0


class TestInABrowser:
    pytestmark = in_a_browser

    @pytest.mark.parametrize("time", [0.1, 0.9, 1.1])
    def test_their_links_are_where_pinocchio_puts_them(
        self, page: Browser, data: run_data.RunData, time: float
    ) -> None:
        page.evaluate(f"report.setTime({time}); report.replay.scene.updateMatrixWorld(true)")
        expected = transforms(data, time)
        for link in ("r_shoulder", "r_elbow", "r_wrist"):
            where = f"report.replay.robots[1].links.get('{link}').getWorldPosition(new THREE.Vector3()).toArray()"
            # The nearest message is up to 2.5 ms away, at 0.1 m/s.
            np.testing.assert_allclose(page.evaluate(where), expected[link][:3, 3], atol=5e-4)

    def test_their_skin_is_where_the_links_have_it(self, page: Browser, data: run_data.RunData) -> None:
        assert data.person is not None
        settings = HumanSettings.of(data.run["definition"]["human"], "human")
        skin = fitted(describe(settings.person), gripping=("right",))
        page.evaluate("report.setTime(0.9); report.replay.scene.updateMatrixWorld(true)")
        mesh = "report.replay.robots[1].skin.object"
        place = "((v) => skin.boneTransform(k, v.fromBufferAttribute(skin.geometry.attributes.position, k)).toArray())"
        drawn = page.evaluate(
            f"((skin) => Array.from({{length: skin.geometry.attributes.position.count}}, (_, k) => {place}"
            f"(new THREE.Vector3())))({mesh})"
        )
        np.testing.assert_allclose(drawn, skin.posed(transforms(data, 0.9)), atol=1e-3)

    def test_a_region_is_coloured_while_it_is_touched(
        self, page: Browser, data: run_data.RunData, run: RunFolder
    ) -> None:
        settings = HumanSettings.of(data.run["definition"]["human"], "human")
        skin = fitted(describe(settings.person), gripping=("right",))
        findings = json.loads((run.path / "verdict.json").read_text())["findings"]
        (contact,) = [one for one in findings if one["regions"] and one["group"] == "contact"]
        colours = "Array.from(report.replay.robots[1].skin.object.geometry.attributes.color.array)"
        # The messages do not say when the contact began, so it is not assessable.
        touching = {f"{contact['side']} {contact['regions'][0]}": None}
        for time, shares in ((sum(contact["window"]) / 2.0, touching), (contact["window"][1] + 0.2, {})):
            page.evaluate(f"report.setTime({time})")
            drawn = np.reshape(page.evaluate(colours), (-1, 3))
            np.testing.assert_allclose(drawn, skin.region_colours(shares), atol=1e-6)

    def test_skin_and_region_colours_agree(self, page: Browser, data: run_data.RunData) -> None:
        settings = HumanSettings.of(data.run["definition"]["human"], "human")
        shares = {"right upper arm, elbow": 0.9, "right hand, fingers": None, "right lower arm, wrist": 1.7}
        page.evaluate(f"report.replay.robots[1].skin.colour({json.dumps(shares)})")
        colours = "Array.from(report.replay.robots[1].skin.object.geometry.attributes.color.array)"
        expected = fitted(describe(settings.person), gripping=("right",)).region_colours(shares)
        np.testing.assert_allclose(np.reshape(page.evaluate(colours), (-1, 3)), expected, atol=1e-6)

    def test_contact_shapes_are_drawn_on_request(self, page: Browser) -> None:
        robot = "report.replay.robots[1]"
        shown = f"[...new Set({robot}.meshes().map(({{ visible }}) => visible))]"
        assert page.evaluate(shown) == [False]
        page.evaluate("document.getElementById('show-shapes').click()")
        assert page.evaluate(shown) == [True] and page.evaluate(f"{robot}.skin.object.material.opacity") < 1.0
        page.evaluate("document.getElementById('show-shapes').click()")
        assert page.evaluate(shown) == [False] and page.evaluate(f"{robot}.skin.object.material.opacity") == 1.0
        note = "[...document.querySelectorAll('.of-skin')].map(({ hidden }) => hidden)"
        assert page.evaluate(note) == [False, False]

    @pytest.mark.parametrize("name", ["right_bic_b", "right_tric_long", "right_lat_dorsi_a"])
    def test_a_muscle_is_drawn_from_end_to_end_where_its_links_are(
        self, page: Browser, data: run_data.RunData, name: str
    ) -> None:
        (person,) = human_and_objects.human(data, 60.0)
        assert person.lines is not None
        index, points = list(person.lines.points).index(name), person.lines.points[name]
        page.evaluate("report.setTime(0.9); report.replay.scene.updateMatrixWorld(true)")
        line, body = f"report.replay.robots[1].lines.lines[{index}]", "report.replay.robots[1].links"
        for k, (link, place) in enumerate(points[:-1]):
            expected = page.evaluate(
                f"{body}.get('{link}').localToWorld(new THREE.Vector3(...{list(place)})).toArray()"
            )
            np.testing.assert_allclose(page.evaluate(f"{line}.parts[{k}].position.toArray()"), expected, atol=1e-6)
        link, place = points[-1]
        last = page.evaluate(f"{body}.get('{link}').localToWorld(new THREE.Vector3(...{list(place)})).toArray()")
        tip = page.evaluate(f"{line}.parts[{len(points) - 2}].localToWorld(new THREE.Vector3(0, 1, 0)).toArray()")
        np.testing.assert_allclose(tip, last, atol=1e-5)

    def test_a_muscle_has_the_colour_of_its_activation(self, page: Browser) -> None:
        colours = "report.replay.robots[1].lines"
        for value, text in ACTIVATION_COLOURS:
            assert "#" + page.evaluate(f"{colours}.colour({value}).getHexString()") == text
        assert "#" + page.evaluate(f"{colours}.colour(1).getHexString()") == ACTIVATION_COLOURS[-1][1]

    def test_activation_is_a_map_of_colours_with_a_row_for_each_muscle(
        self, page: Browser, data: run_data.RunData
    ) -> None:
        assert data.person is not None and data.person.record.muscles is not None
        record = data.person.record.muscles
        page.evaluate("document.getElementById('plot-activation').scrollIntoView()")
        page.wait("document.querySelector('#plot-activation .graph').data !== undefined")
        trace = "document.querySelector('#plot-activation .graph').data[0]"
        assert page.evaluate(f"{trace}.type") == "heatmap"
        row = page.evaluate("document.querySelector('#plot-activation .graph').layout.yaxis.ticktext.indexOf('bic_b')")
        values = page.evaluate(f"Array.from({trace}.z[{row}])")
        np.testing.assert_allclose(values, record.activation[:, record.names.index("right_bic_b")], atol=1e-6)

    def test_the_grip_force_begins_where_it_acts(self, page: Browser, data: run_data.RunData) -> None:
        assert data.person is not None
        (grip,) = data.person.record.grips.values()
        page.evaluate("report.setTime(1.1); report.replay.scene.updateMatrixWorld(true)")
        at = np.argmin(np.abs(grip.time - 1.1))
        arrow = "report.replay.robots[1].arrows[0]"
        assert page.evaluate(f"{arrow}.object.visible") is True
        np.testing.assert_allclose(page.evaluate(f"{arrow}.object.position.toArray()"), grip.point[at], atol=2e-3)
        length = page.evaluate(f"{arrow}.head.position.y")
        assert length == pytest.approx(0.02 * np.linalg.norm(grip.force[at]), rel=0.05)

    @pytest.mark.parametrize(("time", "force"), [(0.5, 0.0), (BLOW + 1e-4, PEAK), (0.85, 40.0), (1.0, 0.0)])
    def test_a_contact_is_drawn_where_it_acts_while_it_lasts(self, page: Browser, time: float, force: float) -> None:
        page.evaluate(f"report.setTime({time})")
        arrow = "report.replay.robots[1].arrows[1]"
        assert page.evaluate(f"{arrow}.object.visible") is (force > 0.0)
        if force:
            assert page.evaluate(f"{arrow}.head.position.y") == pytest.approx(0.002 * force, rel=1e-5)
            tail = np.array(AT) - 0.002 * force * np.array([0.0, 0.6, -0.8])
            np.testing.assert_allclose(page.evaluate(f"{arrow}.object.position.toArray()"), tail, atol=1e-6)

    def test_the_page_shows_their_figures_and_names_their_forces_without_a_problem(self, page: Browser) -> None:
        assert "Grip force" in page.evaluate("document.getElementById('simulated-human').textContent")
        legend = page.evaluate("document.getElementById('view-legend').textContent")
        assert "activation of the muscles" in legend
        assert "force of panda_hand on human::r_wrist" in legend and "contact of lower arm, wrist" in legend
        assert page.problems == [] and page.requests == []

    def test_of_several_runs_each_human_has_the_colour_of_their_robot(
        self, page: Browser, run: RunFolder, tmp_path: Path
    ) -> None:
        words = [str(run.path), str(run.path), "--labels", "one", "two", "--output", str(tmp_path)]
        assert main(["compare", *words, "--html", "--no-figures"]) == 0
        show(page, tmp_path)
        assert page.evaluate("report.replay.robots.map(({ role }) => role)") == ["s0", "s0", "s1", "s1"]
        painted = "report.replay.robots.map((robot) => [...robot.links.values()].flatMap(({ children }) => children).find((o) => o.isMesh).material.color.getHex())"  # noqa: E501
        first, body, second, other = page.evaluate(painted)
        assert first == body != second == other
        assert page.problems == []
        show(page, run.path)
