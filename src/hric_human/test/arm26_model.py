"""OpenSim's model arm26 twice: for OpenSim's own tools, and as a `Body` with an `Anatomy` for the code under test."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import opensim
from bodies import body

from hric_core.geometry import FloatArray, MassProperties
from hric_human.body import Body, BodyJoint, BodySegment
from hric_human.body.joints import ROWS
from hric_human.body.segments import ROOT
from hric_human.control.whole_body import WholeBody
from hric_human.muscles.anatomy import Anatomy, Muscle
from hric_human.muscles.fitting.sample import Paths
from hric_human.muscles.polynomial import Polynomial, monomials

FILE = Path(__file__).parent / "arm26" / "arm26.osim"
COORDINATES = {"sh_flex": "r_shoulder_elev", "el_flex": "r_elbow_flex"}
JOINTS = {"shoulder": "r_shoulder", "elbow": "r_elbow"}
ORDER = 9
"""Order of the polynomials of the muscles' forces on the bones."""
BODIES = {"upper_arm": "r_humerus", "forearm": "r_ulna_radius_hand"}
GRAVITY = (0.0, -9.80665, 0.0)
"""Gravity vector in OpenSim's axes (y up) [m/s^2]."""


class Arm26:
    """The model arm26, with OpenSim's state of it."""

    def __init__(self) -> None:
        opensim.Logger.removeFileSink()
        opensim.Logger.setLevelString("error")
        self.paths = Paths(opensim.Model(str(FILE)))
        self.names = tuple(self.paths.names)
        muscles = self.paths.model.getMuscles()
        self.muscles = [muscles.get(name) for name in self.names]
        self._coordinates = [self.paths.by_name[name] for name in COORDINATES.values()]

    def put(self, q: FloatArray, dq: FloatArray) -> None:
        """Set angles [rad] and speeds [rad/s] of shoulder and elbow."""
        for coordinate, angle, speed in zip(self._coordinates, q, dq, strict=True):
            coordinate.setValue(self.paths.state, float(angle), False)
            coordinate.setSpeedValue(self.paths.state, float(speed))
        self.paths.model.realizeVelocity(self.paths.state)

    def arms(self) -> FloatArray:
        """Return the moment arms of the muscles, shape (6, 2) [m]."""
        state = self.paths.state
        return np.array([[m.computeMomentArm(state, c) for c in self._coordinates] for m in self.muscles])

    def gain(self) -> FloatArray:
        """Return the force per activation as in OpenSim's static optimisation, with a rigid tendon, shape (6,)
        [N]."""
        return np.array([m.calcInextensibleTendonActiveFiberForce(self.paths.state, 1.0) for m in self.muscles])

    @cached_property
    def body(self) -> Body:
        """Return the model as a `Body`, whose axes at the zero pose are OpenSim's."""
        self.put(np.zeros(2), np.zeros(2))
        centres, segments, joints = self.paths.centres(list(JOINTS.values())), {}, {}
        parent, at = ROOT, centres[0]
        text = f'<robot name="arm26"><link name="{ROOT}"/>'
        for (kind, name), row, link in zip(BODIES.items(), COORDINATES, ("r_shoulder", "r_elbow"), strict=True):
            axis = self._axis(JOINTS[{"upper_arm": "shoulder", "forearm": "elbow"}[kind]])
            text += self._link(name, link, f"right_{row}", parent, at, axis)
            none = np.zeros(3)
            mass = MassProperties()
            segments[f"right_{kind}"] = BodySegment(
                f"right_{kind}", kind, link, parent, at, mass, none, none, 0.0, (0, 0)
            )
            joints[f"right_{row}"] = BodyJoint(f"right_{row}", ROWS[row], link, link, axis, (-4.0, 4.0))
            parent, at = link, centres[1] - centres[0]
        return Body(body().subject, text + "</robot>", joints, segments, {}, {}, {}, 0.0)

    def _axis(self, joint: str) -> FloatArray:
        transform = opensim.CustomJoint.safeDownCast(self.paths.model.getJointSet().get(joint)).getSpatialTransform()
        axis = transform.get_rotation1().getAxis().to_numpy()
        return np.asarray(axis / np.linalg.norm(axis))

    def _link(self, name: str, link: str, joint: str, parent: str, at: FloatArray, axis: FloatArray) -> str:
        one = self.paths.model.getBodySet().get(name)
        com, inertia = one.getMassCenter().to_numpy(), one.getInertia()
        moments, products = inertia.getMoments().to_numpy(), inertia.getProducts().to_numpy()
        values = dict(zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), [*moments, *products], strict=True))
        return (
            f'<link name="{link}"><inertial><origin xyz="{_text(com)}"/><mass value="{one.getMass()!r}"/><inertia '
            + " ".join(f'{key}="{float(value)!r}"' for key, value in values.items())
            + f'/></inertial></link><joint name="{joint}" type="continuous"><parent link="{parent}"/>'
            f'<child link="{link}"/><origin xyz="{_text(at)}"/><axis xyz="{_text(axis)}"/></joint>'
        )

    def anatomy(self, lower: tuple[float, float], upper: tuple[float, float]) -> Anatomy:
        """Return the model's muscles as an `Anatomy`, fitted over a range of angles [rad].

        The order of the polynomials is high enough for muscles that come off a wrapping surface.
        """
        grid = np.stack(np.meshgrid(*np.linspace(lower, upper, 25).T), axis=-1).reshape(-1, 2)
        rows = [self._pulls(q) for q in grid]
        terms, joints = monomials(grid, ORDER), tuple(COORDINATES)
        fitted = {name: dict[str, tuple[Polynomial, ...]]() for name in self.names}
        for centre in JOINTS:
            found, *_ = np.linalg.lstsq(terms, np.array([row[centre].ravel() for row in rows]))
            for k, of in enumerate(fitted.values()):
                of[centre] = tuple(
                    Polynomial(joints, ORDER, tuple(part)) for part in found.T[3 * k : 3 * k + 3].tolist()
                )
        none = Polynomial((), 0, (0.0,))
        muscles = {name: Muscle(name, 1.0, 1.0, 0.0, none, pulls, ()) for name, pulls in fitted.items()}
        return Anatomy("arm26", joints, lower, upper, muscles, {}, "see arm26/README.md", {})

    def _pulls(self, q: FloatArray) -> dict[str, FloatArray]:
        """Return the muscles' pulls by joint centre, in axes of the ground and of the humerus, shape (6, 3) [1]."""
        self.put(q, np.zeros(2))
        lines = self.paths.lines()
        R_ground_humerus, _ = self.paths.frame(BODIES["upper_arm"])
        beyond = {"shoulder": list(BODIES.values()), "elbow": [BODIES["forearm"]]}
        pulls = {centre: lines.pull(self.paths.numbers(names)) for centre, names in beyond.items()}
        return pulls | {"elbow": pulls["elbow"] @ R_ground_humerus}

    @cached_property
    def whole(self) -> WholeBody:
        """Return the body's dynamics for inverse dynamics."""
        return WholeBody(self.body)


def _text(values: FloatArray) -> str:
    return " ".join(repr(float(value)) for value in values)


class OpenSimRun:
    """Results of OpenSim's analysis tool for a motion: static optimisation, and joint reactions with its forces.

    Attributes:
        time: times of the motion, shape (n,) [s].
        q, dq, ddq: motion as the tool computes it from its splines, shape (n, 2) each [rad], [rad/s], [rad/s^2].
        activation, force: shape (n, 6) [1], [N].
        reactions: force of the proximal on the distal bone, in the ground, by centre, shape (n, 3) [N].
    """

    def __init__(self, folder: Path, names: tuple[str, ...], time: FloatArray, q: FloatArray) -> None:
        self._folder, self._end = folder, float(time[-1])
        _write(folder / "motion.sto", time, q)
        self._run("so", opensim.StaticOptimization(), opensim.Kinematics())
        self.time, activation = self._read("so_StaticOptimization_activation.sto")
        self.activation, self.force = (
            _columns(activation, names),
            _columns(self._read("so_StaticOptimization_force.sto")[1], names),
        )
        self.q = _columns(self._read("so_Kinematics_q.sto")[1], COORDINATES.values())
        self.dq = _columns(self._read("so_Kinematics_u.sto")[1], COORDINATES.values())
        speeds = opensim.GCVSplineSet(5, opensim.Storage(str(folder / "so_Kinematics_u.sto")))
        self.ddq = np.array([[speeds.evaluate(i, 1, float(t)) for i in range(2)] for t in self.time])
        reaction = opensim.JointReaction()
        reaction.setName("JointReaction")
        reaction.setForcesFileName(str(folder / "so_StaticOptimization_force.sto"))
        self._run("jr", reaction)
        _, loads = self._read("jr_JointReaction_ReactionLoads.sto")
        self.reactions = {
            centre: _columns(loads, [f"{joint}_on_{body}_in_ground_f{axis}" for axis in "xyz"])
            for (centre, joint), body in zip(JOINTS.items(), BODIES.values(), strict=True)
        }

    def _run(self, name: str, *analyses: Any) -> None:
        tool = opensim.AnalyzeTool()
        tool.setName(name)
        tool.setModelFilename(str(FILE))
        tool.setCoordinatesFileName(str(self._folder / "motion.sto"))
        tool.setInitialTime(0.0)
        tool.setFinalTime(self._end)
        tool.setResultsDir(str(self._folder))
        tool.setReplaceForceSet(False)
        tool.setSolveForEquilibrium(False)
        for analysis in analyses:
            analysis.setStartTime(0.0)
            analysis.setEndTime(self._end)
            analysis.setInDegrees(False)
            tool.updAnalysisSet().cloneAndAppend(analysis)
        tool.printToXML(str(self._folder / f"{name}.xml"))
        opensim.AnalyzeTool(str(self._folder / f"{name}.xml")).run()

    def _read(self, name: str) -> tuple[FloatArray, dict[str, FloatArray]]:
        table = opensim.TimeSeriesTable(str(self._folder / name))
        columns = zip(table.getColumnLabels(), table.getMatrix().to_numpy().T, strict=True)
        return np.array(table.getIndependentColumn()), dict(columns)


def _write(path: Path, time: FloatArray, q: FloatArray) -> None:
    table = opensim.TimeSeriesTable()
    table.setColumnLabels(list(COORDINATES.values()))
    table.addTableMetaDataString("inDegrees", "no")
    for instant, row in zip(time.tolist(), q.tolist(), strict=True):
        table.appendRow(instant, opensim.RowVector(row))
    opensim.STOFileAdapter.write(table, str(path))


def _columns(table: dict[str, FloatArray], names: Any) -> FloatArray:
    return np.array([table[name] for name in names]).T
