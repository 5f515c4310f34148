"""Muscles of a user's OpenSim model keep their own curves: against OpenSim's muscles and its static optimisation."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import opensim
import pytest
from arm26_model import FILE, Arm26
from bodies import body

from hric_core.errors import HricError
from hric_human.muscles import Anatomy, MuscleSet, load
from hric_human.muscles.curves import LENGTHS, SPEEDS, SampledCurves
from hric_human.muscles.fitting import any_arm
from hric_human.muscles.fitting.certificate import certify
from hric_human.muscles.fitting.opensim_curves import DEPRECATED, CurveBench
from hric_human.muscles.fitting.opensim_model import OpenSimArm

CLASSES = (
    "Thelen2003Muscle",
    "Millard2012EquilibriumMuscle",
    "DeGrooteFregly2016Muscle",
    "Schutte1993Muscle_Deprecated",
)
NEAR = 0.005
"""Largest error of a sampled curve between its samples, per maximum isometric force [1]."""


@cache
def arm26_anatomy() -> Anatomy:
    return any_arm.fit(OpenSimArm(FILE), FILE.name)


def test_fitted_arm26_has_the_activations_of_opensims_tool() -> None:
    certificate = certify(FILE, arm26_anatomy())
    assert certificate is not None
    print(certificate)
    assert certificate.rms <= 0.02 and certificate.largest <= 0.05
    assert certificate.highest > 0.1


def test_fitted_force_per_activation_is_that_of_opensims_muscles() -> None:
    arm, muscles, missed = Arm26(), MuscleSet(body(parts="right_arm"), arm26_anatomy()), []
    names = [name.removeprefix("right_") for name in muscles.names[: muscles.muscle_count]]
    draw = np.random.default_rng(2)
    for q in draw.uniform(arm26_anatomy().lower, arm26_anatomy().upper, (50, 2)):
        dq = draw.uniform(-1.0, 1.0, 2)
        arm.put(q, dq)
        expected = dict(zip(arm.names, arm.gain(), strict=True))
        found = muscles.at([q[0], 0.0, 0.0, q[1], 0.0, 0.0, 0.0], [dq[0], 0.0, 0.0, dq[1], 0.0, 0.0, 0.0]).gain
        for name, scaled, gain in zip(names, muscles.scaled, found, strict=False):
            muscle = arm26_anatomy().muscles[name]
            missed.append(gain / scaled.force - expected[name] / muscle.max_force)
    print(f"force per activation: {np.sqrt(np.mean(np.square(missed))):.4f} RMS of the maximum isometric force")
    assert np.sqrt(np.mean(np.square(missed))) < 0.02


@pytest.mark.parametrize("kind", CLASSES)
def test_curves_of_each_class_are_near_opensims(tmp_path: Path, kind: str) -> None:
    model = arm26_of(tmp_path, kind)
    bench = CurveBench(model)
    for name in ("TRIlong", "BRA"):
        curves = bench.sampled(name)
        assert isinstance(curves, SampledCurves), curves
        muscle = bench._model.getMuscles().get(name)
        unit = muscle.getOptimalFiberLength() * np.cos(muscle.getPennationAngleAtOptimalFiberLength())
        for length in (0.55, 0.713, 0.987, 1.151):
            active, speed = np.interp(length, LENGTHS, curves.active), np.interp(length, LENGTHS, curves.speed)
            for velocity in (-4.03, -0.51, 0.0, 0.47, 3.03):
                ours = active * np.interp(velocity * speed / curves.max_velocity, SPEEDS, curves.velocity)
                theirs = bench._active(muscle, unit, length, velocity)
                if kind.endswith(DEPRECATED):
                    theirs -= bench._active(muscle, unit, length, velocity, activation=0.0)
                assert ours == pytest.approx(theirs, abs=NEAR)


def test_a_longer_muscle_has_more_passive_force(tmp_path: Path) -> None:
    for kind in CLASSES:
        curves = CurveBench(arm26_of(tmp_path, kind)).sampled("BRA")
        assert isinstance(curves, SampledCurves)
        slack, short, long = np.interp((0.9, 1.2, 1.5), LENGTHS, curves.passive)
        assert slack < 0.05 and 0.0 <= short < long and long > 0.1


def arm26_of(folder: Path, kind: str) -> object:
    """Return arm26 with muscles of another class."""
    path = folder / f"{kind}.osim"
    text = FILE.read_text().replace("Thelen2003Muscle", kind)
    path.write_text(re.sub("<optimal_force>.*</optimal_force>", "", text))
    opensim.Logger.setLevelString("off")
    return OpenSimArm(path).model


def test_a_muscle_without_velocity_is_refused_before_sampling(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "still.osim"
    text = FILE.read_text()
    tag = "<max_contraction_velocity>"
    assert tag in text
    parts = text.split(tag)
    path.write_text(tag.join([parts[0], *("0" + part[part.index("</") :] for part in parts[1:])]))
    monkeypatch.setattr(any_arm, "_sampled", lambda *_: pytest.fail("the poses are sampled"))
    with pytest.raises(HricError, match="TRIlong: its max_contraction_velocity is 0; valid: above 0"):
        any_arm.fit(OpenSimArm(path), path.name)


def test_curves_for_some_muscles_only_are_refused(tmp_path: Path) -> None:
    anatomy = arm26_anatomy()
    mixed = dict(anatomy.muscles) | {"BRA": replace(anatomy.muscles["BRA"], curves=None)}
    replace(anatomy, muscles=mixed).save(tmp_path / "mixed.json")
    with pytest.raises(HricError, match="some muscles have curves and others have none"):
        load(tmp_path / "mixed.json")


def test_curves_with_a_missing_sample_are_refused(tmp_path: Path) -> None:
    arm26_anatomy().save(tmp_path / "short.json")
    text = (tmp_path / "short.json").read_text()
    (tmp_path / "short.json").write_text(text.replace('"active": [', '"active": [0.5, ', 1))
    with pytest.raises(HricError, match="curves have"):
        load(tmp_path / "short.json")
