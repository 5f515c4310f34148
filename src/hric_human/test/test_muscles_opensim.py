"""The built-in muscles against OpenSim's own DeGrooteFregly2016Muscle on the human's model."""

from pathlib import Path

import numpy as np
import opensim
import pytest
from bodies import body

import urdf_to_osim
from hric_human.body import Body
from hric_human.muscles import BUILT_IN, MuscleSet, load
from hric_human.muscles.drive import MuscleDrive
from hric_human.muscles.opensim_paths import NOTE, with_muscles

STATES = 1000


def test_activation_rises_and_falls_as_in_opensim():
    model = opensim.Model()
    muscle = opensim.DeGrooteFregly2016Muscle()
    muscle.setName("muscle")
    muscle.set_ignore_tendon_compliance(True)
    muscle.set_max_isometric_force(1.0)
    ball = opensim.Body("ball", 1.0, opensim.Vec3(0), opensim.Inertia(1))
    model.addBody(ball)
    model.addJoint(opensim.SliderJoint("slider", model.getGround(), ball))
    muscle.addNewPathPoint("a", model.getGround(), opensim.Vec3(0))
    muscle.addNewPathPoint("b", ball, opensim.Vec3(0.3, 0, 0))
    model.addForce(muscle)
    state, drive = model.initSystem(), MuscleDrive(MuscleSet(body(), load(BUILT_IN)), 1e-3)
    muscle = opensim.Muscle.safeDownCast(model.getForceSet().get("muscle"))
    for activation, excitation in ((0.1, 0.9), (0.9, 0.1), (0.3, 0.35), (0.01, 1.0)):
        model.setStateVariableValue(state, "/forceset/muscle/activation", activation)
        muscle.setControls(opensim.Vector(1, excitation), controls := opensim.Vector(1, 0.0))
        model.realizeVelocity(state)
        model.setControls(state, controls)
        model.realizeDynamics(state)
        model.realizeAcceleration(state)
        rate = model.getComponent("/forceset/muscle").getStateVariableDerivativeValue(state, "activation")
        speed = drive.approach_speed(activation, excitation)
        assert speed * (excitation - activation) == pytest.approx(rate, rel=1e-9)


@pytest.mark.parametrize("subject", ["P50_male", "P05_female"])
def test_the_same_muscles_in_human_osim_have_equal_lengths_arms_and_forces(tmp_path: Path, subject: str):
    human = body(subject, parts="both_arms")
    model, coordinates, muscles = _model(human, tmp_path)
    ours = MuscleSet(human, load(BUILT_IN))
    rng, anatomy = np.random.default_rng(17), load(BUILT_IN)
    worst = np.zeros(3)
    for _ in range(STATES):
        q, dq = np.zeros(len(human.joints)), rng.normal(0.0, 1.5, len(human.joints))
        for i, name in enumerate(human.joints):
            plain = name.partition("_")[2]
            if plain in anatomy.joints:
                j = anatomy.joints.index(plain)
                q[i] = rng.uniform(anatomy.lower[j], anatomy.upper[j])
        activation = rng.uniform(0.01, 1.0, len(ours.names))
        worst = np.maximum(worst, _differences(model, coordinates, muscles, ours, q, dq, activation))
    print(f"{subject}: length {worst[0]:.1e} m, moment arm {worst[1]:.1e} m, force {worst[2]:.1e} N")
    assert worst[0] < 1e-9 and worst[1] < 1e-9 and worst[2] < 0.01


def test_the_model_says_that_its_joint_reactions_miss_the_muscles(tmp_path: Path):
    _model(body(parts="right_arm"), tmp_path)
    assert NOTE in (tmp_path / "human.osim").read_text()
    assert "JointReaction" in NOTE


def _model(human: Body, folder: Path):
    options = urdf_to_osim.Options(inertia="keep", stops=False, friction="none", meshes=False)
    path = folder / "human.osim"
    urdf_to_osim.write(urdf_to_osim.convert(human.urdf, options), path)
    path.write_text(with_muscles(path.read_text(), MuscleSet(human, load(BUILT_IN))))
    model = opensim.Model(str(path))
    state = model.initSystem()
    names = [name for name in MuscleSet(human, load(BUILT_IN)).names if name[-1] not in "+-"]
    muscles = [opensim.Muscle.safeDownCast(model.getForceSet().get(name)) for name in names]
    return (model, state), [model.getCoordinateSet().get(name) for name in human.joints], muscles


def _differences(made, coordinates, muscles, ours, q, dq, activation):
    model, state = made
    for coordinate, angle, speed in zip(coordinates, q, dq, strict=True):
        coordinate.setValue(state, angle, False)
        coordinate.setSpeedValue(state, speed)
    mine = ours.at(q.tolist(), dq.tolist())
    rows = [k for k, is_one in enumerate(ours.is_muscle) if is_one]
    for k, muscle in zip(rows, muscles, strict=True):
        muscle.setActivation(state, activation[k])
    model.realizeVelocity(state)
    model.equilibrateMuscles(state)
    model.realizeDynamics(state)
    worst = np.zeros(3)
    forces = mine.forces(activation)
    for k, muscle in zip(rows, muscles, strict=True):
        fibre = muscle.getOptimalFiberLength() * mine.length[k] + muscle.getTendonSlackLength()
        length = abs(fibre - muscle.getLength(state))
        arms = [
            abs(muscle.getPath().computeMomentArm(state, coordinates[j]) - mine.arms[k, c])
            for c, j in enumerate(ours.joints)
            if abs(mine.arms[k, c]) > 0.0
        ]
        worst = np.maximum(worst, [length, max(arms), abs(muscle.getActuation(state) - forces[k])])
    return worst
