"""Page of a run: content, size, and behaviour in a browser."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import report_run
import synthetic
from browser import Browser, installed

import panda_description
from hric_analysis import recordings
from hric_analysis.recordings import Moving, Recordings, Signal
from hric_analysis.tracking_run import tip_positions
from hric_bags.reader import ControlRecord, RunRecord, read
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.errors import HricError
from hric_report import headline, sections
from hric_report import html as report_html
from hric_report.figure import Curve, Figure, Panel
from hric_report.html import moving, page, run_data, run_page, scene
from hric_report.thinning import thin


def in_a_browser(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test as slow, because it needs a browser."""
    without = pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
    return pytest.mark.slow(without(test))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    folder = report_run.write_run(tmp_path_factory.mktemp("runs"))
    report_html.write(folder)
    return folder


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as found:
        yield found


@pytest.fixture(scope="module")
def opened(browser: Browser, run: RunFolder) -> Browser:
    """Return the page of the run with all plots drawn."""
    browser.emulate(scheme="light")
    browser.open(run.path / report_html.NAME)
    browser.wait("typeof report === 'object' && report.ready === true")
    browser.evaluate("report.drawAll()")
    return browser


@pytest.fixture
def shown(opened: Browser) -> Browser:
    """Return the page, with plots from the begin to the end of the run."""
    opened.evaluate("report.setRange([report.begin, report.end]); report.setTime(report.begin)")
    return opened


def test_thinning_keeps_every_peak() -> None:
    time = np.linspace(0.0, 1.0, 100_000)
    values = np.sin(20.0 * time)
    values[[777, 50_001]] = [9.0, -9.0]
    plot = Figure(
        "a",
        "A",
        "",
        (Panel("", (Curve("c", "s0", time, values), Curve("d", "s1", time, -values))),),
    )
    thinned, kept = thin([plot], 4000)
    first, second = thinned[0].panels[0].curves
    assert kept is not None and len(first.values) <= 2000
    assert first.values.max() == 9.0 and first.values.min() == -9.0
    assert first.time is second.time and np.all(np.diff(first.time) > 0)


def test_a_short_run_is_shown_whole() -> None:
    time = np.arange(100.0)
    plot = Figure("a", "A", "", (Panel("", (Curve("c", "s0", time, time),)),))
    assert thin([plot], 4000) == ([plot], None)


def test_ten_minutes_with_every_sensor_make_less_than_20_MB(run: RunFolder) -> None:
    text = page.render_page(run_page.build(_long(run, duration=600.0)))
    assert len(text.encode()) < 20e6
    assert "Long curves are reduced" in text


def _long(run: RunFolder, duration: float) -> run_data.RunData:
    """Write a run with 1 kHz, 8 channels of 2 kHz, a plate of 1 kHz, 20 markers, and noise, which does not compress."""
    rng = np.random.default_rng(1)
    time = np.arange(0.0, duration, 1e-3)
    arrays = [rng.normal(size=(len(time), 9)) for _ in range(2)]
    log = ControlRecord(
        report_run.JOINTS, ("effort",) * 9, time, arrays[0], arrays[1], arrays[1], arrays[1], arrays[0], 0, (), ()
    )
    emg = np.arange(0.0, duration, 5e-4)
    signals = [Signal("/emg", "[V]", tuple(f"m{k}" for k in range(8)), emg, rng.normal(size=(len(emg), 8)))]
    signals.append(Signal("/plate", "[N]", ("x", "y", "z"), time, arrays[0][:, :3]))
    seen = time[::10]
    moving = [Moving("marker", f"m{k}", "panda_link0", seen, arrays[0][::10, :3]) for k in range(20)]
    return run_data.RunData(
        run,
        run.read(),
        report_html.metrics_of(run),
        RunRecord(log),
        None,
        Recordings(signals, moving),
        panda_description.load(hand=True),
    )


def test_a_run_without_a_description_has_a_page_without_a_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = synthetic.write_run(tmp_path)
    assert main(["report", str(folder.path), "--html", "--no-figures"]) == 0
    text = (folder.path / report_html.NAME).read_text()
    assert "There is no replay" in text and str(folder.path / report_html.NAME) in capsys.readouterr().out


def test_what_a_message_says_stays_text(run: RunFolder) -> None:
    text = (run.path / report_html.NAME).read_text()
    assert report_run.NASTY not in text and "&lt;/script&gt;&lt;script&gt;document.title" in text


@pytest.mark.parametrize(
    "word",
    [
        "no samples (starving)",
        "approach",
        "error: no samples",
        "Synchronised on /hric/perception/sync",
        "nothing since 1 s",
        "resample",
    ],
)
def test_events_and_the_quality_of_synchronisation_are_on_the_page(run: RunFolder, word: str) -> None:
    assert word in (run.path / report_html.NAME).read_text()


def test_samples_in_chunks_are_shown_at_their_times_and_by_their_units(run: RunFolder) -> None:
    found = recordings.read(run.bag_path, float).signals
    plate = {signal.unit: signal for signal in found if signal.topic.endswith("samples")}
    assert {unit: signal.channels for unit, signal in plate.items()} == {"[N]": ("Fx", "Fz"), "[N m]": ("Mx",)}
    assert np.all(plate["[N]"].values == [1.0, 2.0]) and np.all(plate["[N m]"].values == 3.0)
    emg = next(signal for signal in found if signal.topic.endswith("emg/raw"))
    assert emg.values.shape == (2 * report_run.CYCLES, report_run.CHANNELS)
    assert np.allclose(emg.time, np.arange(2 * report_run.CYCLES) / 2000.0, atol=1e-8)


def test_a_page_names_no_folder_of_the_machine(run: RunFolder) -> None:
    text = (run.path / report_html.NAME).read_text()
    assert not [folder for folder in (str(run.path.parent), f"{Path(__file__).parents[3]}/src") if folder in text]


def test_a_lost_mesh_is_noted_and_the_rest_is_drawn(run: RunFolder) -> None:
    data = run_data.load(run, report_html.metrics_of(run))
    lost = replace(data, description=data.description.replace("link3.obj", "gone.obj"))
    assert "drawn without its mesh" in page.render_page(run_page.build(lost))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["a", "b", "c"], "valid: with --html, or two runs"),
        (["a", "b", "c", "--html", "--labels", "x", "y"], "--labels needs 3 names, one for each run; given: x, y"),
    ],
)
def test_a_wrong_comparison_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    for name in "abc":
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.yaml").write_text("{}")
    assert main(["compare", *words, "--runs", str(tmp_path)]) == 2
    assert told in capsys.readouterr().err


def test_what_was_found_comes_first_and_how_it_was_made_last(run: RunFolder) -> None:
    text = (run.path / report_html.NAME).read_text()
    titles = re.findall(r"<section id=[^>]*><h2>([^<]*)", text)
    assert titles == [title for title in sections.ORDER if title in titles]
    assert titles[0] == sections.RESULTS and titles[-1] == sections.MADE and sections.EMG in titles
    shown = re.findall(r"<dt>([^<]*)</dt><dd class=value>([^<]*)", text)
    assert [name for name, _ in shown][:3] == ["Final error", "Settling time", "Overshoot"]
    assert ("Samples lost", "0") in shown and ("Skew", "0.100 ms") in shown
    assert text.index("Settling time") < text.index("Joint positions</h3>")


def test_a_note_on_the_page_is_no_disclaimer_before_the_findings(tmp_path: Path) -> None:
    text = page.render_page(page.Page("a", "b", findings=[headline.KeyFigure("Lag", "1 ms", "late")], notes=["beware"]))
    assert text.index("Lag") < text.index("beware")


def test_a_time_code_is_no_muscle(run: RunFolder) -> None:
    found = recordings.signals(run.bag_path, float)
    assert found and not [signal for signal in found if "time" in signal.channels]


def test_the_robot_has_the_colours_of_its_meshes(run: RunFolder) -> None:
    blob = scene.Blob()
    drawn = scene.PageScene(blob)
    drawn.add(moving.robot(run_data.load(run, report_html.metrics_of(run)), 60.0, []))
    hand = next(link for link in drawn.data()["robots"][0]["links"] if link["name"] == "panda_hand")
    shades = {round(sum(visual["rgba"][:3]), 2) for visual in hand["visuals"]}
    assert len(shades) >= 3, "the Panda's hand is white, light and dark"


def test_a_chain_of_joints_that_mimic_each_other_is_drawn_by_the_column_at_its_end() -> None:
    text = '<robot name="r"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>' + "".join(
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>{law}</joint>'
        for name, parent, child, law in (
            ("last", "c", "d", '<mimic joint="middle" multiplier="3" offset="0.5"/>'),
            ("middle", "b", "c", '<mimic joint="first" multiplier="-2" offset="0.1"/>'),
            ("first", "a", "b", ""),
        )
    )
    drawn = scene.PageScene(scene.Blob())
    drawn.add(scene.SceneRobot("", f"{text}</robot>", ("first",), np.zeros(1), np.zeros((1, 1))))
    joints = {joint["name"]: joint for joint in drawn.data()["robots"][0]["joints"]}
    assert (joints["last"]["column"], joints["last"]["multiplier"]) == (0, -6.0)
    assert joints["last"]["offset"] == pytest.approx(0.8)


def test_a_broken_module_from_outside_is_named(run: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "hric_figures_broken.py").write_text("import nothing_of_this_name")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(HricError, match=r"cannot import the figures of the module hric_figures_broken: No module"):
        run_page.build(run_data.load(run, report_html.metrics_of(run)))


@in_a_browser
def test_a_plot_is_saved_for_a_column_of_a_journal_in_light_colours(shown: Browser) -> None:
    shown.emulate(scheme="dark")
    bytes_of = """report.plots.find(({ spec }) => spec.key === 'positions').picture('%s', %d)
        .then(async (blob) => [...new Uint8Array(await blob.arrayBuffer())])"""
    png = bytes(shown.evaluate(bytes_of % ("png", 85)))
    assert png.startswith(b"\x89PNG") and int.from_bytes(png[16:20], "big") == pytest.approx(85 / 25.4 * 300, abs=1)
    assert b"pHYs" + (11811).to_bytes(4, "big") * 2 in png
    svg = ElementTree.fromstring(bytes(shown.evaluate(bytes_of % ("svg", 170))))
    assert svg.attrib["width"] == "170mm" and "rgb(31, 95, 168)" in ElementTree.tostring(svg, "unicode")
    caption = bytes(shown.evaluate(bytes_of % ("txt", 0))).decode()
    assert caption.startswith("Joint positions (made_up_panda")
    shown.emulate(scheme="light")


@in_a_browser
def test_no_legend_covers_a_title_or_a_panel(shown: Browser) -> None:
    covered = shown.evaluate("""report.plots.flatMap(({ spec, graph, frame }) => {
      const legend = frame.parentElement.querySelector('.legend').getBoundingClientRect();
      const titles = [...graph.querySelectorAll('.annotation, .subplot')].map((one) => one.getBoundingClientRect());
      return titles.some((one) => one.top < legend.bottom - 1) ? [spec.key] : [];
    })""")
    assert covered == []


@in_a_browser
def test_on_a_narrow_screen_what_was_found_still_comes_before_the_replay(shown: Browser) -> None:
    shown.call("Emulation.setDeviceMetricsOverride", width=420, height=900, deviceScaleFactor=1, mobile=False)
    top = "document.getElementById('%s').getBoundingClientRect().top"
    found, replay, motion = (shown.evaluate(top % name) for name in ("key-figures", "replay", "motion"))
    shown.call("Emulation.clearDeviceMetricsOverride")
    assert found < replay < motion


@in_a_browser
def test_end_effector_and_marker_leave_trails_and_the_plate_is_where_it_stands(shown: Browser) -> None:
    robot = "report.replay.robots[0]"
    shown.evaluate("report.setTime(1.9); report.replay.scene.updateMatrixWorld(true)")
    points = shown.evaluate(f"{robot}.trails.map(({{ role, object }}) => [role, object.geometry.drawRange.count])")
    assert {role for role, _ in points} == {"measured", "marker"} and all(count > 50 for _, count in points)
    (plate,) = shown.evaluate(
        f"{robot}.plates.map((plate) => [plate.object.getWorldPosition(new THREE.Vector3()).toArray(), plate.arrow.object.visible])"  # noqa: E501
    )
    assert np.allclose(plate[0], [0.6, 0.0, 0.05], atol=1e-6) and plate[1] is True


@in_a_browser
def test_the_browser_logs_no_problem_and_sends_no_request(shown: Browser) -> None:
    shown.evaluate("new Promise((done) => setTimeout(done, 500))")
    assert shown.problems == [] and shown.requests == []
    assert shown.evaluate("document.title") == "made_up_panda"


@in_a_browser
def test_every_curve_is_drawn(shown: Browser) -> None:
    lines = "p.graph.querySelectorAll('.scatterlayer path.js-line').length"
    drawn = shown.evaluate(
        f"report.plots.map((p) => [p.spec.title, p.panels.flatMap((q) => q.curves).length, {lines}])"
    )
    assert len(drawn) >= 6
    assert all(wanted == found for _, wanted, found in drawn), drawn


@in_a_browser
def test_every_link_is_drawn(shown: Browser) -> None:
    counts = shown.evaluate(
        """(() => {
          const { robots, renderer, scene, camera, grid } = report.replay, context = renderer.getContext(), [robot] = robots, found = {};
          report.replay.draw();
          grid.visible = false;
          scene.background.set(0x00ff00);
          for (const { object } of robot.tracks) object.visible = false;
          const meshes = [...robot.links.values()].flatMap((link) => link.children.filter((o) => o.isMesh));
          const size = [context.drawingBufferWidth, context.drawingBufferHeight], pixels = new Uint8Array(4 * size[0] * size[1]);
          for (const link of robot.links.values()) {
            for (const mesh of meshes) mesh.visible = mesh.parent === link;
            if (!link.children.some((o) => o.isMesh)) continue;
            renderer.render(scene, camera);
            context.readPixels(0, 0, ...size, context.RGBA, context.UNSIGNED_BYTE, pixels);
            let count = 0;
            for (let k = 0; k < pixels.length; k += 4) if (pixels[k] > 0 || pixels[k + 2] > 0) count++;
            found[link.name] = count;
          }
          grid.visible = true;
          for (const mesh of meshes) mesh.visible = true;
          report.replay.paint();
          return found;
        })()"""  # noqa: E501
    )
    arm = {f"panda_link{k}" for k in range(8)} | {"panda_hand", "panda_leftfinger", "panda_rightfinger"}
    assert arm <= set(counts)
    assert min(counts.values()) > 20, counts


@in_a_browser
@pytest.mark.parametrize("time", [0.0, 0.7, 1.9])
def test_the_replay_shows_the_robot_where_it_was(shown: Browser, run: RunFolder, time: float) -> None:
    shown.evaluate(f"report.setTime({time}); report.replay.scene.updateMatrixWorld(true)")
    place = "report.replay.robots[0].links.get('panda_leftfinger').getWorldPosition(new THREE.Vector3()).toArray()"
    log = read(run.bag_path).log
    expected = tip_positions(run.urdf_path.read_text(), log, "panda_link0", "panda_leftfinger", np.zeros(3))[
        round(time * 1000)
    ]
    # Between instants of 1/60 s the joints are taken as moving evenly.
    assert np.allclose(shown.evaluate(place), expected, atol=2e-4)


@in_a_browser
def test_markers_are_in_the_frame_of_tf_and_lost_bodies_vanish(shown: Browser) -> None:
    shown.evaluate("report.setTime(1.0); report.replay.scene.updateMatrixWorld(true)")
    tracks = (
        "Object.fromEntries(report.replay.robots[0].tracks.map(({ name, object }) => [name, "
        "object.getWorldPosition(new THREE.Vector3()).toArray()]))"
    )
    # x, y of the stream (0.1, 0.3) are (-0.3, 0.1) in the base, 0.5 m further in x.
    found = shown.evaluate(tracks)
    assert np.allclose(found["hand/a"], [0.2, 0.1, 0.3], atol=1e-3)
    assert np.allclose(found["body hand"], [0.2, 0.1, 0.3], atol=1e-3)
    visible = "report.replay.robots[0].tracks.find(({ name }) => name === 'body hand').object.visible"
    assert shown.evaluate(visible) is True
    assert shown.evaluate(f"report.setTime(0.2), {visible}") is False


@in_a_browser
def test_a_zoom_shows_the_same_time_in_all_plots(shown: Browser) -> None:
    shown.evaluate("Plotly.relayout(report.plots[0].graph, { 'xaxis.range[0]': 0.5, 'xaxis.range[1]': 0.6 }), null")
    shown.wait("report.range[0] === 0.5 && report.range[1] === 0.6")
    assert shown.evaluate("report.plots[1].draw(), report.plots[1].graph.layout.xaxis.range") == [0.5, 0.6]
    assert shown.evaluate("report.plots[0].graph.data.find(({ name }) => name === 'measured').x.length") < 110
    assert shown.problems == []


@in_a_browser
def test_a_click_on_an_event_shows_its_moment(shown: Browser) -> None:
    shown.evaluate(
        "[...document.querySelectorAll('tr.event')].find((row) => row.textContent.includes('approach')).click()"
    )
    assert shown.evaluate("document.getElementById('now').textContent") == "0.700 s"


@in_a_browser
def test_a_dark_system_gets_a_dark_page_and_paper_a_light_one(browser: Browser, shown: Browser) -> None:
    background = "getComputedStyle(document.body).backgroundColor"
    assert shown.evaluate(background) == "rgb(255, 255, 255)"
    shown.emulate(scheme="dark")
    shown.wait(f"{background} === 'rgb(20, 23, 26)'")
    shown.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert shown.evaluate(background) == "rgb(255, 255, 255)"
    assert shown.evaluate("[...document.querySelectorAll('details')].every((one) => one.open)") is True
    assert shown.evaluate("report.plots.every((plot) => plot.graph.querySelector('path.js-line'))") is True
    shown.evaluate("dispatchEvent(new Event('afterprint'))")
    assert shown.evaluate(background) == "rgb(20, 23, 26)"
    shown.emulate(scheme="light")


@in_a_browser
def test_three_runs_make_one_page_with_three_robots(browser: Browser, tmp_path: Path) -> None:
    runs = [report_run.write_run(tmp_path, f"run{k}", scale) for k, scale in enumerate((1.0, 0.9, 1.1))]
    words = [str(run.path) for run in runs] + [
        "--labels",
        "one",
        "two",
        "three",
        "--html",
        "--no-figures",
        "--output",
        str(tmp_path / "compared"),
    ]
    assert main(["compare", *words]) == 0
    browser.open(tmp_path / "compared" / report_html.NAME)
    browser.wait("typeof report === 'object' && report.ready === true")
    positions = "report.plots.find(({ spec }) => spec.key === 'positions')"
    browser.evaluate(f"{positions}.draw(); report.replay.draw()")
    assert browser.evaluate("report.replay.robots.map((robot) => robot.label)") == ["one", "two", "three"]
    assert browser.evaluate("document.querySelector('.finding .value').textContent") == "80.0 mrad"
    assert browser.evaluate(f"{positions}.graph.data.slice(0, 4).map(({{ name }}) => name)") == [
        "setpoint",
        "one",
        "two",
        "three",
    ]
    assert browser.problems == [] and browser.requests == []


@in_a_browser
def test_bounds_and_bands_are_drawn(browser: Browser, tmp_path: Path) -> None:
    time = np.linspace(1.0, 2.0, 100)
    panels = tuple(Panel(name, (Curve("c", "s0", time, time),), (("limit", 1.5),)) for name in "ab")
    shown = Figure("bands", "Bands", "[m]", panels, bands=(("lost", 1.2, 1.4),))
    (tmp_path / report_html.NAME).write_text(page.render_page(page.Page("a", "b", figures=[shown])))
    browser.open(tmp_path / report_html.NAME)
    browser.wait("typeof report === 'object' && report.plots.length === 1")
    shapes = browser.evaluate("report.drawAll(), report.plots[0].graph.layout.shapes")
    assert [(one["type"], one["x0"], one["y0"]) for one in shapes] == [("rect", 1.2, 0), ("line", 0, 1.5)] * 2
    assert browser.evaluate("document.querySelectorAll('#plot-bands .shapelayer path').length") == 4
    assert browser.problems == []
