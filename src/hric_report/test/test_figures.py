"""Content of figures."""

from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest

from hric_analysis.recordings import Signal
from hric_report import drawing, sections, style
from hric_report.figure import Curve, Figure, Panel, per_joint
from hric_report.figures import topics
from hric_report.heat import COLUMNS, heat_map
from hric_report.html.page import Page, render_page

TIME = np.linspace(0.0, 1.0, 11)
SCALE = ((0.0, "#000000"), (0.5, "#ff0000"))


def _figure(*curves: Curve, bounds: tuple[tuple[str, float], ...] = (), **options: float | bool) -> Figure:
    return Figure("a", "A", "[rad]", (Panel("", curves, bounds),), **options)


def _range(figure: Figure) -> tuple[float, float]:
    return figure.vertical_range(figure.panels[0])


@pytest.mark.parametrize(("bound", "high"), [(1.5, 1.55), (2.0, 1.05), (0.5, 1.05)])
def test_a_bound_near_the_curves_is_on_the_axis_and_a_far_one_does_not_flatten_them(bound: float, high: float) -> None:
    ramp = Curve("measured", "measured", TIME, TIME)
    assert _range(_figure(ramp, bounds=(("limit", bound),))) == pytest.approx((-0.05, high))


def test_rounding_errors_do_not_fill_a_panel() -> None:
    still = Curve("measured", "measured", TIME, 3.0 + 1e-16 * TIME)
    assert _range(_figure(still, min_height=0.2)) == pytest.approx((2.89, 3.11))


def test_a_request_far_beyond_what_was_sent_is_cut_off() -> None:
    sent, requested = Curve("sent", "measured", TIME, TIME), Curve("requested", "raw", TIME, 100.0 * TIME, cut=True)
    low, high = _range(_figure(requested, sent))
    assert -1.0 < low < 0.0 and 1.0 < high < 3.0


def test_gaps_and_empty_curves_have_no_say_in_the_range() -> None:
    gap = Curve("a", "s0", TIME, np.where(TIME > 0.5, np.nan, TIME))
    assert _range(_figure(gap, Curve("b", "s1", np.empty(0), np.empty(0)))) == pytest.approx((-0.025, 0.525))


def test_a_joint_without_values_has_no_panel() -> None:
    values = np.column_stack([TIME, np.full_like(TIME, np.nan), -TIME])
    figure = per_joint("a", "A", "[rad]", ("j1", "j2", "j3"), [Curve("measured", "measured", TIME, values)])
    assert [panel.title for panel in figure.panels] == ["j1", "j3"]
    assert np.array_equal(figure.panels[1].curves[0].values, -TIME)


def test_a_figure_without_any_value_is_left_out(tmp_path: Path) -> None:
    unknown = Curve("measured", "measured", TIME, np.full((len(TIME), 2), np.nan))
    figure = per_joint("a", "A", "[rad]", ("j1", "j2"), [unknown])
    assert drawing.draw(tmp_path, [figure], "made up") == []
    assert "plot-a" not in render_page(Page("a", "b", figures=[figure]))


def test_every_part_of_a_figure_is_drawn(tmp_path: Path) -> None:
    curves = tuple(Curve(role, role, TIME, TIME + k) for k, role in enumerate(style.ROLES))
    panel = Panel("", curves, (("limit", 1.2),))
    plain = Figure("plain", "Plain", "[m]", (panel,) * 3, bands=(("lost", 0.2, 0.4),))
    equal = Figure("equal", "Equal", "[m]", (panel,) * 3, columns=3, equal=True)
    logarithmic = Figure("log", "Log", "[m]", (Panel("", (Curve("a", "s0", TIME, TIME + 1e-3),)),), logarithmic=True)
    files = drawing.draw(tmp_path, [plain, equal, logarithmic], "made up")
    assert [path.name for path in files] == ["plain.png", "equal.png", "log.png"]
    drawn = {f"{name}.{kind}" for name in ("plain", "equal", "log") for kind in ("png", "svg")}
    assert {path.name for path in tmp_path.iterdir()} == {*drawn, "captions.md"}


@pytest.mark.parametrize(("panels", "width"), [(1, style.SINGLE), (4, style.DOUBLE)])
def test_a_figure_is_as_wide_as_one_or_two_columns_of_a_journal_at_300_dots_per_inch(
    tmp_path: Path, panels: int, width: float
) -> None:
    figure = Figure("a", "A", "[rad]", (Panel("j", (Curve("measured", "measured", TIME, TIME),)),) * panels)
    (path,) = drawing.draw(tmp_path, [figure], "made up")
    header = path.read_bytes()
    assert int.from_bytes(header[16:20], "big") == pytest.approx(width / 25.4 * 300, abs=1)
    assert b"pHYs" + (11811).to_bytes(4, "big") * 2 in header
    root = ElementTree.parse(path.with_suffix(".svg")).getroot()
    assert float(root.attrib["width"].removesuffix("pt")) == pytest.approx(width / 25.4 * 72, abs=0.1)


def test_the_legend_of_many_curves_covers_no_title_and_stays_within_the_figure() -> None:
    curves = tuple(Curve(f"a rather long name {k}", f"s{k}", TIME, TIME + k) for k in range(10))
    figure = Figure("a", "A", "[rad]", (Panel("a title of the panel", curves),) * 2)
    with plt.rc_context(drawing.STYLE):
        drawn = drawing.drawn(figure, {})
        drawn.canvas.draw()
        legend = drawn.legends[0].get_window_extent()
        assert drawn.bbox.x0 <= legend.x0 and legend.x1 <= drawn.bbox.x1 and legend.y1 <= drawn.bbox.y1 + 1.0
        assert all(ax.title.get_window_extent().y1 <= legend.y0 + 1.0 for ax in drawn.axes)
        plt.close(drawn)


def test_a_caption_names_the_run_and_says_what_is_seen(tmp_path: Path) -> None:
    figure = _figure(Curve("measured", "measured", TIME, TIME)).about("Motion", "A ramp.")
    drawing.draw(tmp_path, [figure], "made up")
    assert "**a.png, a.svg.** A (made up). A ramp." in (tmp_path / "captions.md").read_text()
    assert "A (made up). A ramp." in (tmp_path / "a.svg").read_text()


def test_a_sensor_that_shows_one_value_has_an_axis_that_can_be_read() -> None:
    low, high = _range(_figure(Curve("Mx", "s0", TIME, np.full_like(TIME, 3.0))))
    assert high - low == pytest.approx(0.33) and low < 3.0 < high


@pytest.mark.parametrize(
    ("topic", "section", "title"),
    [
        ("/hric/perception/emg/raw", sections.EMG, "Muscle activity"),
        ("/hric/perception/force_plate/left/wrench", sections.PLATE, "Load on force plate left"),
        ("/franka_state_controller/F_ext", sections.FORCES, "External wrench on the end effector"),
        ("/my/topic", sections.OTHER, "/my/topic"),
    ],
)
def test_what_a_sensor_measured_is_found_by_its_meaning(topic: str, section: str, title: str) -> None:
    (figure,) = topics.figures(SimpleNamespace(signals=[Signal(topic, "[V]", ("a",), TIME, TIME[:, None])]))  # type: ignore[arg-type]
    assert (figure.section, figure.title) == (section, title) and topic in figure.caption


def test_a_map_of_colours_keeps_each_peak_however_many_instants_there_are() -> None:
    time = np.arange(20 * COLUMNS + 7) * 1e-3
    values = np.zeros((len(time), 2))
    values[4321, 0], values[5, 1] = 0.4, np.nan
    heat = heat_map(("a", "b"), time, values, "activation [1]", SCALE)
    assert heat.values.shape == (COLUMNS, 2) and heat.values[:, 0].max() == 0.4 and not np.isnan(heat.values).any()
    assert heat.time[heat.values[:, 0].argmax()] == pytest.approx(time[4321], abs=0.021)
    assert heat.top == 0.5


def test_a_map_of_colours_is_drawn_with_its_rows_and_is_on_the_page(tmp_path: Path) -> None:
    heat = heat_map(("long head", "short head"), TIME, np.column_stack([TIME, 1.0 - TIME]), "activation [1]", SCALE)
    figure = Figure("activation", "Activation", "", (Panel("", (), heat=heat),)).about(sections.HUMAN, "What it is.")
    (path,) = drawing.draw(tmp_path, [figure], "a run")
    svg = path.with_suffix(".svg").read_text()
    assert "long head" in svg and "short head" in svg and "activation [1]" in svg and "time [s]" in svg
    page = render_page(Page("a run", "", figures=[figure]))
    assert '"rows":["long head","short head"]' in page and '"scale":[[0.0,"#000000"],[0.5,"#ff0000"]]' in page
