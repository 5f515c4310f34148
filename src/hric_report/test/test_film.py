"""Films of a run: what `hric film` writes, as read by the library that encodes it, and what it refuses."""

import itertools
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import av
import numpy as np
import pytest
import report_run
from browser import installed
from PIL import Image

from hric_bags.run_folder import RunFolder
from hric_core.command import perform
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_report import html
from hric_report.film import browser
from hric_report.film.command import FilmCommand, check_encoder, write
from hric_report.film.pictures import FilmView, Pictures, opened
from hric_report.html import run_data

in_a_browser = pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with pictures installs it")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    return report_run.write_run(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="module")
def film(run: RunFolder, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., tuple[Path, list[FloatArray]]]:
    """Return a function that makes a film with some options and returns its file and pictures."""
    folder = tmp_path_factory.mktemp("films")

    def make(name: str, *options: str) -> tuple[Path, list[FloatArray]]:
        path = folder / name
        words = ["--output", str(path), "--size", "320x180", "--fps", "10", *options]
        assert perform(["film", str(run.path), *words]) == 0
        with av.open(str(path)) as container:
            return path, [frame.to_ndarray(format="rgb24").astype(float) for frame in container.decode(video=0)]

    return make


@pytest.fixture(scope="module")
def scene(run: RunFolder) -> Iterator[Pictures]:
    with opened(run_data.load(run, html.metrics_of(run))) as pictures:
        yield pictures


@in_a_browser
@pytest.mark.slow
@pytest.mark.parametrize(("name", "codec"), [("a.mp4", "h264"), ("a.webm", "vp9")])
def test_film_lasts_as_long_as_its_part(film: Callable[..., tuple[Path, list[FloatArray]]], name: str, codec: str):
    path, pictures = film(name, "--from", "0.5", "--to", "1.5", "--speed", "0.5")
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        found = stream.codec_context.name, stream.width, stream.height, float(stream.average_rate or 0.0)
        assert container.duration == pytest.approx(2.1e6, abs=1e5)  # [us]
    assert found == (codec, 320, 180, 10.0)
    assert len(pictures) == 21


@in_a_browser
@pytest.mark.slow
def test_pictures_of_a_film_show_motion(film: Callable[..., tuple[Path, list[FloatArray]]]) -> None:
    _, pictures = film("b.mp4")
    changes = [np.abs(after - before).max() for before, after in itertools.pairwise(pictures)]
    assert np.median(changes) > 30.0


@in_a_browser
@pytest.mark.slow
def test_picture_shows_the_whole_arm(scene: Pictures) -> None:
    scene.prepare(FilmView(320, 180), scene.begin, scene.end)
    picture = np.asarray(scene.draw(0.5 * scene.end), dtype=float)
    rows, columns = np.nonzero(np.abs(picture - picture[0, 0]).max(axis=2) > 100.0)  # dark parts of the arm
    assert len(rows) > 0.005 * 320 * 180
    assert rows.min() > 2 and rows.max() < 177 and columns.min() > 2 and columns.max() < 317


@in_a_browser
@pytest.mark.slow
def test_every_picture_is_repeatable(scene: Pictures) -> None:
    scene.prepare(FilmView(320, 180), scene.begin, scene.end)
    first = scene.draw(1.0)
    scene.draw(0.2)
    assert np.array_equal(np.asarray(first), np.asarray(scene.draw(1.0)))


@in_a_browser
@pytest.mark.slow
def test_span_outside_the_run_is_refused(run: RunFolder, tmp_path: Path) -> None:
    with pytest.raises(HricError, match=r"--from 1 --to 99; valid: times from 0\.000 to 1\.999 s"):
        perform(["film", str(run.path), "--output", str(tmp_path / "a.mp4"), "--from", "1", "--to", "99"])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--output", "a.gif"], r"--output is a\.gif; valid: a file \.mp4 or \.webm"),
        (["--output", "nowhere/a.mp4"], r"in an existing folder"),
        (["--size", "321x180"], r"--size is '321x180'; valid: WIDTHxHEIGHT, even numbers"),
        (["--size", "320"], r"--size is '320'"),
        (["--speed", "0"], r"--speed is 0\.0; valid"),
        (["--fps", "nan"], r"--fps is nan; valid"),
    ],
)
def test_invalid_option_names_the_valid_ones(run: RunFolder, words: list[str], message: str) -> None:
    with pytest.raises(HricError, match=message):
        perform(["film", str(run.path), *words])


def test_missing_browser_names_the_set_up(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(HricError, match="Chromium is not installed; run scripts/setup --with pictures"):
        browser.Browser(tmp_path)


def test_missing_encoder_names_the_set_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(HricError, match="Python package av; run scripts/setup --with pictures"):
        check_encoder()


def test_interrupted_film_leaves_the_earlier_one(tmp_path: Path) -> None:
    def interrupted() -> Iterator[Image.Image]:
        yield Image.new("RGB", (64, 64))
        raise KeyboardInterrupt

    path = tmp_path / "film.mp4"
    path.write_text("earlier")
    with pytest.raises(KeyboardInterrupt):
        write(path, interrupted(), (64, 64), 30.0)
    assert [item.name for item in tmp_path.iterdir()] == ["film.mp4"]
    assert path.read_text() == "earlier"


def test_help_names_every_option() -> None:
    text = FilmCommand().parser("film").format_help()
    assert all(option in text for option in ("--output", "--speed", "--size", "--fps", "--from", "--to"))
