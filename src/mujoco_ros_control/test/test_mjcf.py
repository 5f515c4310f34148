"""The scene as MJCF: compiled again by MuJoCo, it is the same scene in the same state."""

import mujoco
import numpy as np
import pytest

from hric_core.command import main

Q = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]


def test_the_written_scene_is_the_simulated_one(make_plant, panda_urdf):
    plant = make_plant(panda_urdf, q=Q)
    written = mujoco.MjModel.from_xml_string(plant.mjcf())
    ours = plant.world.scene.m
    for name in ("nq", "nv", "ngeom", "npair"):
        assert getattr(written, name) == getattr(ours, name)
    names = ("body_mass", "body_pos", "dof_armature", "dof_damping", "jnt_range", "geom_pos", "geom_size")
    for name in names:
        np.testing.assert_allclose(getattr(written, name), getattr(ours, name), rtol=1e-5, atol=1e-6, err_msg=name)
    state = mujoco.MjData(written)
    mujoco.mj_resetDataKeyframe(written, state, 0)
    mujoco.mj_forward(written, state)
    mass = np.zeros((written.nv, written.nv))
    mujoco.mj_fullM(written, state, mass) if mujoco.mj_fullM.__doc__.count("MjData") else mujoco.mj_fullM(
        written, mass, state.qM
    )
    np.testing.assert_allclose(state.qpos, Q, atol=1e-5)
    np.testing.assert_allclose(mass - np.diag(written.dof_armature), plant.mass_matrix(), atol=1e-4)


def test_an_experiment_with_a_person_is_described_as_mjcf(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["describe", "mjcf", "hand_guidance"]) == 0
    model = mujoco.MjModel.from_xml_string(capsys.readouterr().out)
    names = [model.joint(k).name for k in range(model.njnt)]
    assert "panda::panda_joint1" in names and any(name.endswith("right_el_flex") for name in names)


def test_another_engine_has_no_mjcf(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["describe", "mjcf", "pd_step", "simulator:=pybullet"]) == 2
    assert "PyBulletPlant has no MJCF; valid: simulator:=mujoco" in capsys.readouterr().err
