"""OpenSim's inverse dynamics of the exported model, motion and loads gives the moments of this project."""

from pathlib import Path

import numpy as np
import opensim
import pytest
from standing_person import JOINTS, RATE, standing, supporting

from hric_core.trial.c3d import Trial
from hric_core.trial.opensim_text import read_storage
from hric_motion.hand_loads import HandLoad, loaded_moments
from hric_motion.moments import joint_moments
from hric_report.trial.opensim_files import write_dynamics, write_model

HANDS = HandLoad(("right", "left"), mass=8.0, begin=0.5)


@pytest.mark.parametrize(("loaded", "hands"), [(True, None), (False, None), (False, HANDS)])
def test_opensim_finds_the_same_moments(
    tmp_path: Path, loaded: bool, hands: HandLoad | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = standing()
    if hands is None:
        result = joint_moments(motion, RATE, {1: supporting(motion)} if loaded else {}, cutoff=20.0)
    else:
        nothing = np.zeros((0, 0))
        result = loaded_moments(motion, Trial("x", RATE, (), nothing, 0.0, (), (), nothing, {}, "z"), hands)
    write_model(tmp_path, motion.body)
    write_dynamics(tmp_path, result)
    monkeypatch.chdir(tmp_path)
    opensim.Logger.setLevelString("off")
    opensim.InverseDynamicsTool("inverse_dynamics.xml").run()
    solved = read_storage(tmp_path / "moments.sto")
    inside = (result.motion.time > (0.2 if hands is None else 0.6)) & (
        result.motion.time < result.motion.time[-1] - 0.2
    )
    errors = {}
    for column, name in enumerate(JOINTS):
        theirs = np.interp(result.motion.time, solved.time, solved.columns[f"{name}_moment"])
        ours = result.needed.torque[:, column]
        errors[name] = np.abs(ours - theirs)[inside].max() / max(np.abs(ours[inside]).max(), 1.0)
    print({name: f"{100 * error:.2f} %" for name, error in errors.items()})
    assert max(errors.values()) < 0.02
