"""Comparison of fitted muscles with OpenSim's StaticOptimization tool on a short motion of the user's model.

Both share out the same torque: that of the tool's muscle forces about the model's exact moment arms. As in the tool,
passive forces are left out; those of OpenSim's deprecated muscles are part of its active force.
"""

import logging
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import opensim

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.muscles.anatomy import Anatomy, Certificate
from hric_human.muscles.curves import LENGTHS, SPEEDS, SampledCurves
from hric_human.muscles.fitting.fit import rounded
from hric_human.muscles.fitting.opensim_curves import DEPRECATED
from hric_human.muscles.fitting.opensim_model import OpenSimArm
from hric_human.muscles.fitting.placing import Placing
from hric_human.muscles.fitting.sample import members, poses
from hric_human.muscles.static_optimization import MINIMUM, StaticOptimization

LOG = logging.getLogger("hric.human.muscles")
FRAMES, CHECKED = 41, slice(8, 33)
"""Number of frames of the motion of 1 s, and those compared: OpenSim's splines spoil both ends."""
MOTION = {"sh_flex": (0.1, 0.4), "sh_abd": (0.1, 0.3), "el_flex": (0.3, 1.5)}
"""First and last angle of joints in the motion, which lifts the hand; 0 for other joints [rad]; project default."""
TRIES = 64
"""Number of motions that are tried until the model's ranges allow one."""
LIMIT = 120.0
"""Maximum duration of OpenSim's tool [s]."""
RESERVE = 1.0
"""Torque per activation of actuators that help OpenSim's muscles [N m]."""
WORST = 3
"""Number of muscles named in a certificate."""
_RUN = "import sys, opensim; opensim.Logger.setLevelString('error'); opensim.AnalyzeTool(sys.argv[1]).run()"


def certify(path: Path, anatomy: Anatomy) -> Certificate | None:
    """Compare fitted muscles with OpenSim's tool; return None, and log the reason, if the tool has no result.

    Args:
        path: OpenSim model.
        anatomy: muscles fitted from it.
    """
    model = OpenSimArm(path)
    placing = Placing(model)
    try:
        motion = _motion(placing, model, anatomy)
        activation, forces = _static_optimization(path, model, placing.coordinates, motion.coordinates)
    except HricError as error:
        LOG.warning("%s: no comparison with OpenSim's static optimisation: %s", model.name, error)
        return None
    columns = [placing.joints.index(name) for name in anatomy.joints]
    used = [list(model.muscles).index(name) for name in anatomy.muscles]
    kinds = [model.model.getMuscles().get(name).getConcreteClassName() for name in anatomy.muscles]
    solver, found = StaticOptimization(len(used), len(columns)), []
    for n in range(FRAMES)[CHECKED]:
        arms, gain = _state(anatomy, motion.q[n, columns], motion.dq[n, columns], kinds)
        torque = forces[n, used] @ motion.arms[n][np.ix_(used, columns)]
        found.append(solver.solve(arms, gain, torque).activation)
    missed = np.array(found) - activation[CHECKED][:, used]
    rms = dict(zip(anatomy.muscles, np.sqrt((missed**2).mean(axis=0)).tolist(), strict=True))
    return Certificate(
        rounded(float(np.sqrt((missed**2).mean()))),
        rounded(float(np.abs(missed).max())),
        rounded(float(activation[CHECKED][:, used].max())),
        {name: rounded(rms[name]) for name in sorted(rms, key=lambda name: -rms[name])[:WORST]},
    )


class _Motion:
    """Minimum-jerk motion of 1 s between two poses.

    Attributes:
        q, dq: positions [rad] and velocities [rad/s] of the model's arm joints, shape (FRAMES, m).
        arms: moment arms of the model's K muscles, shape (FRAMES, K, m) [m].
        coordinates: the model's coordinates in each frame, by name [rad] or [m].
    """

    def __init__(self, ends: FloatArray) -> None:
        t = np.linspace(0.0, 1.0, FRAMES)[:, None]
        self.q = ends[0] + (10.0 * t**3 - 15.0 * t**4 + 6.0 * t**5) * (ends[1] - ends[0])
        self.dq = (30.0 * t**2 - 60.0 * t**3 + 30.0 * t**4) * (ends[1] - ends[0])
        self.arms: list[FloatArray] = []
        self.coordinates: list[Mapping[str, float]] = []


def _motion(placing: Placing, model: OpenSimArm, anatomy: Anatomy) -> _Motion:
    """Return the first motion within the model's ranges. Raises HricError: there is none among TRIES."""
    ranges = {name: hinge.range for name, hinge in placing.hinges.items()}
    ranges |= zip(anatomy.joints, zip(anatomy.lower, anatomy.upper, strict=True), strict=True)
    lower, upper = np.array([ranges.get(name, (0.0, 0.0)) for name in placing.joints]).T
    ends = np.clip(np.array([MOTION.get(name, (0.0, 0.0)) for name in placing.joints]).T, lower, upper)
    starts = poses(lower.tolist(), upper.tolist(), TRIES)
    for both in [ends, *([start, 0.5 * (start + ends[1])] for start in starts)]:
        moved = _Motion(np.array(both))
        for q in moved.q:
            if not placing.put(q) or (slopes := placing.slopes(q)) is None:
                break
            moved.arms.append(-slopes)
            moved.coordinates.append(model.angles)
        if len(moved.arms) == FRAMES:
            return moved
    raise HricError(f"none of {len(starts)} motions is within the ranges of its coordinates")


def _state(anatomy: Anatomy, q: FloatArray, dq: FloatArray, kinds: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Return moment arms, shape (k, m) [m], and force per activation as in OpenSim's tool, shape (k,) [N]."""
    arms, gain = np.zeros((len(anatomy.muscles), len(q))), np.zeros(len(anatomy.muscles))
    for k, (muscle, kind) in enumerate(zip(anatomy.muscles.values(), kinds, strict=True)):
        acts = [anatomy.joints.index(name) for name in muscle.length.joints]
        arms[k, acts] = -muscle.length.gradients(q[None, acts])[0]
        length = (muscle.length.values(q[None, acts])[0] - muscle.slack_length) / muscle.optimal_length
        gain[k] = muscle.max_force * _factor(muscle.curves, length, -arms[k] @ dq / muscle.optimal_length, kind)
    return arms, gain


def _factor(curves: SampledCurves | None, length: float, velocity: float, kind: str) -> float:
    """Return the force of the tool's muscle at full activation, per maximum isometric force [1]."""
    if curves is None:
        raise ValueError("muscles fitted from an OpenSim model have curves of their own")
    active, passive, speed = (np.interp(length, LENGTHS, of) for of in (curves.active, curves.passive, curves.speed))
    force = active + passive if kind.endswith(DEPRECATED) else active
    return float(force * np.interp(velocity * speed / curves.max_velocity, SPEEDS, curves.velocity))


def _static_optimization(
    path: Path, model: OpenSimArm, moving: Sequence[str], coordinates: Sequence[Mapping[str, float]]
) -> tuple[FloatArray, FloatArray]:
    """Return activations [1] and forces [N] of the tool, shape (FRAMES, K) each.

    Raises:
        HricError: the tool fails, or takes longer than LIMIT.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_model(path, folder / "model.osim", moving, model.dependent)
        _write_motion(folder / "motion.sto", coordinates)
        _write_tool(folder)
        try:
            done = subprocess.run(
                [sys.executable, "-c", _RUN, str(folder / "tool.xml")], capture_output=True, text=True, timeout=LIMIT
            )
        except subprocess.TimeoutExpired as error:
            raise HricError(f"OpenSim's tool takes longer than {LIMIT:g} s") from error
        results = [folder / f"so_StaticOptimization_{kind}.sto" for kind in ("activation", "force")]
        if done.returncode or not all(result.is_file() for result in results):
            last = (done.stderr or done.stdout).strip().splitlines()[-1:]
            raise HricError(f"OpenSim's tool fails: {''.join(last)}")
        activation, forces = (_columns(result, model.muscles) for result in results)
    if len(activation) != FRAMES or not np.isfinite(activation).all():
        raise HricError(f"OpenSim's tool solves only {len(activation)} of {FRAMES} frames")
    return activation, forces


def _write_model(path: Path, output: Path, moving: Sequence[str], dependent: Sequence[str]) -> None:
    """Write the model with all coordinates locked that the motion does not move, and with reserve actuators."""
    model = opensim.Model(str(path))
    for coordinate in members(model.getCoordinateSet()):
        name = coordinate.getName()
        coordinate.set_clamped(False)
        if name in moving:
            reserve = opensim.CoordinateActuator(name)
            reserve.setName(f"reserve_{name}")
            reserve.setOptimalForce(RESERVE)
            reserve.thisown = 0  # the model owns it
            model.addForce(reserve)
        elif name not in dependent:
            coordinate.set_locked(True)
    for muscle in members(model.getMuscles()):
        muscle.setMinControl(MINIMUM)
    model.finalizeConnections()
    model.printToXML(str(output))


def _write_motion(path: Path, coordinates: Sequence[Mapping[str, float]]) -> None:
    table = opensim.TimeSeriesTable()
    table.setColumnLabels(list(coordinates[0]))
    table.addTableMetaDataString("inDegrees", "no")
    for time, row in zip(np.linspace(0.0, 1.0, FRAMES).tolist(), coordinates, strict=True):
        table.appendRow(time, opensim.RowVector([float(value) for value in row.values()]))
    opensim.STOFileAdapter.write(table, str(path))


def _write_tool(folder: Path) -> None:
    tool, analysis = opensim.AnalyzeTool(), opensim.StaticOptimization()
    tool.setName("so")
    tool.setModelFilename(str(folder / "model.osim"))
    tool.setCoordinatesFileName(str(folder / "motion.sto"))
    tool.setInitialTime(0.0)
    tool.setFinalTime(1.0)
    tool.setResultsDir(str(folder))
    tool.setReplaceForceSet(False)
    tool.setSolveForEquilibrium(False)
    analysis.setStartTime(0.0)
    analysis.setEndTime(1.0)
    analysis.setInDegrees(False)
    tool.updAnalysisSet().cloneAndAppend(analysis)
    tool.printToXML(str(folder / "tool.xml"))


def _columns(path: Path, names: Sequence[str]) -> FloatArray:
    table = opensim.TimeSeriesTable(str(path))
    labels: list[Any] = list(table.getColumnLabels())
    return np.asarray(table.getMatrix().to_numpy()[:, [labels.index(name) for name in names]])
