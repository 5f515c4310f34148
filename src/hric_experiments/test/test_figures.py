"""What a figure shows, and what is drawn of it."""

from pathlib import Path

import numpy as np
import pytest

from hric_experiments.report import png
from hric_experiments.report.figure import Curve, Figure, Panel, per_joint
from hric_experiments.report_html.page import Page, render_page

TIME = np.linspace(0.0, 1.0, 11)


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
    assert png.draw(tmp_path, [figure], "made up") == []
    assert "plot-a" not in render_page(Page("a", "b", figures=[figure]))


def test_every_part_of_a_figure_is_drawn(tmp_path: Path) -> None:
    curves = tuple(Curve(role, role, TIME, TIME + k) for k, role in enumerate(png.STYLES))
    panel = Panel("", curves, (("limit", 1.2),))
    plain = Figure("plain", "Plain", "[m]", (panel,) * 3, bands=(("lost", 0.2, 0.4),))
    equal = Figure("equal", "Equal", "[m]", (panel,) * 3, columns=3, equal=True)
    logarithmic = Figure("log", "Log", "[m]", (Panel("", (Curve("a", "s0", TIME, TIME + 1e-3),)),), logarithmic=True)
    files = png.draw(tmp_path, [plain, equal, logarithmic], "made up")
    assert [path.name for path in files] == ["plain.png", "equal.png", "log.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["equal.png", "log.png", "plain.png"]
