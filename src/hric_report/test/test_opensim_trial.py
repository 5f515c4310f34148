"""OpenSim's inverse dynamics of the exported model, motion and loads gives the moments of this project."""

from pathlib import Path

import numpy as np
import opensim
import pytest
from standing_person import JOINTS, RATE, standing, supporting

from hric_core.trial.opensim_text import read_storage
from hric_motion.moments import joint_moments
from hric_report.trial.opensim_files import write_dynamics, write_model


@pytest.mark.parametrize("loaded", [True, False])
def test_opensim_finds_the_same_moments(tmp_path: Path, loaded: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    motion = standing()
    result = joint_moments(motion, RATE, {1: supporting(motion)} if loaded else {}, cutoff=20.0)
    write_model(tmp_path, motion.body)
    write_dynamics(tmp_path, result)
    monkeypatch.chdir(tmp_path)
    opensim.Logger.setLevelString("off")
    opensim.InverseDynamicsTool("inverse_dynamics.xml").run()
    solved = read_storage(tmp_path / "moments.sto")
    inside = (result.motion.time > 0.2) & (result.motion.time < result.motion.time[-1] - 0.2)
    errors = {}
    for column, name in enumerate(JOINTS):
        theirs = np.interp(result.motion.time, solved.time, solved.columns[f"{name}_moment"])
        ours = result.needed.torque[:, column]
        errors[name] = np.abs(ours - theirs)[inside].max() / max(np.abs(ours[inside]).max(), 1.0)
    print({name: f"{100 * error:.2f} %" for name, error in errors.items()})
    assert max(errors.values()) < 0.02
