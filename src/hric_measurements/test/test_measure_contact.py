"""Virtual measurement of one contact: device, filter, film, and the sheet."""

import math
from pathlib import Path

import numpy as np
import pytest
from contact_courses import expected_peak

from hric_assessment.contact.limits import Limits
from hric_assessment.contact.measured import quantities
from hric_assessment.findings import DISCLAIMER
from hric_control.plants.contact_law import ContactLaw, Layer
from hric_core.command import main
from hric_measurements.contact.instrument import Instrument
from hric_measurements.speed_map.device import HitBody, MeasuringDevice

STEP, PAD = 1e-3, Layer(50e3, 50e3, 5e-3)
TIME = STEP * np.arange(20)
PULSE = 100.0 * np.sin(math.pi * TIME / 0.02)


def test_a_pad_acts_in_series_with_the_spring() -> None:
    device, x, v, mass = MeasuringDevice(HitBody(math.inf, 75e3, pad=PAD), 4.0, STEP), 0.0, 0.5, 4.0
    while not device.apart:
        a = -device.push(x, v) / mass
        x, v = x + STEP * (v + 0.5 * STEP * a), v + STEP * a
    law = ContactLaw(30e3, layers=(Layer(75e3), PAD))
    assert device.peak == pytest.approx(expected_peak(law, mass, 0.5), rel=0.01)
    assert device.energy == pytest.approx(0.5 * mass * 0.5**2, rel=0.01)


def test_a_filter_lowers_a_short_peak() -> None:
    assert Instrument().filtered(PULSE.tolist(), STEP).max() == PULSE.max()
    slow, fast = (Instrument(cutoff=cutoff).filtered(PULSE.tolist(), STEP).max() for cutoff in (20.0, 200.0))
    assert slow < 0.7 * PULSE.max() < 0.97 * PULSE.max() < fast


def test_a_filter_keeps_a_slow_force() -> None:
    slow = np.concatenate([np.linspace(0.0, 80.0, 500), np.full(1000, 80.0)])
    assert Instrument(cutoff=50.0).filtered(slow.tolist(), STEP)[700:1300] == pytest.approx(80.0, rel=1e-3)


@pytest.mark.parametrize(
    ("film", "area", "expected"),
    [
        (1e-3, 1e-4, 100.0 / 1e-4),
        (2e-3, 1.1e-4, 100.0 / 1.08e-4),
        (2e-2, 1e-4, None),
        (None, 1e-4, None),
        (1e-3, None, None),
    ],
)
def test_a_film_reads_whole_cells(film: float | None, area: float | None, expected: float | None) -> None:
    assert Instrument(film=film, area=area).pressure(100.0) == (expected and pytest.approx(expected))


def test_an_unknown_pressure_is_never_within_limits() -> None:
    measured = quantities(PULSE, STEP, 0.1, Instrument().pressure, Limits.named(), "hand, fingers")
    rows = {row.name: row for row in measured}
    assert rows["transient force [N]"].result == f"{100.0 * PULSE.max() / 280.0:.0f} % of the limit"
    assert rows["transient mean pressure [N/cm^2]"].result == "not known"
    assert rows["energy [J]"].result == "20 % of the limit"


def test_the_command_writes_its_sheet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    peaks = {}
    for clamped in ([], ["--clamped"]):
        words = [*clamped, "--cutoff", "100", "--film", "0.001", "--contact-area", "1e-4"]
        assert main(["measure_contact", *words, "-o", str(tmp_path / "sheet.pdf")]) == 0
        out = capsys.readouterr().out
        assert DISCLAIMER in out
        peaks[bool(clamped)] = float(out.split("transient force [N]")[1].split()[0])
        content = (tmp_path / "sheet.pdf").read_bytes()
        assert content.startswith(b"%PDF") and len(content) > 10_000
    assert peaks[True] > peaks[False]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--region", "face"], "permits no contact with face"),
        (["--position", "2", "0", "0.4"], "is out of reach"),
        (["--cutoff", "600"], "--cutoff"),
        (["--contact-area", "0.4"], "--contact-area"),
    ],
)
def test_a_wrong_word_is_refused(capsys: pytest.CaptureFixture[str], words: list[str], message: str) -> None:
    assert main(["measure_contact", *words]) == 2
    assert message in capsys.readouterr().err
