"""Anatomy of any model of an arm, unchanged: nothing is repaired, and unusable muscles are left out and reported.

    anatomy = any_arm.fit(OpenSimArm(Path("arm26.osim")), "arm26.osim")

Lengths and moment arms are both those of the model's motion; if couplers let a shoulder girdle follow the arm, moment
arms include the girdle, as in OpenSim. Joints that the model does not have, or has no muscles for, are left to ideal
actuators by `MuscleSet`.
"""

import logging
import math

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.muscles.anatomy import CENTRES, Anatomy, FitError, Muscle, MusclePath
from hric_human.muscles.fitting.delft import RANGE, SAMPLES, UNSEEN
from hric_human.muscles.fitting.fit import NO_ARM, arm_errors, fit_error, fit_muscle, rounded
from hric_human.muscles.fitting.model import ArmModel
from hric_human.muscles.fitting.placing import Placing
from hric_human.muscles.fitting.sample import MuscleSamples, poses

LOG = logging.getLogger("hric.human.muscles")
WORKING = {**RANGE, "wr_flex": (-60.0, 60.0), "wr_dev": (-15.0, 25.0)}
"""Range of a fit by joint, if the model reaches it [deg]; project default."""
LONGEST_ARM = 0.12
"""Moment arm beyond which a path jumps from one side of a bone to the other [m]; project default."""
MAX_JUMPS = 0.05
"""Largest share of poses in which a path may jump; project default."""
WORST_FIT = 0.006
"""Largest root mean square error of moment arms of a muscle that is used [m]; project default."""
FAR_OFF = 0.02
"""Error of a moment arm at a pose beyond which the path jumps there [m]; project default."""
FEWEST_SAMPLES = 192
"""Poses of a fit of one joint, doubled for each further joint, up to the built-in anatomy's; project default."""
FIBRES = (0.4, 1.6)
"""Usual range of fibre length per optimal length, beyond which a muscle is reported [1]; project default."""
SHARE = SAMPLES // UNSEEN
"""Number of poses of the fit per pose of its test."""
_REPORTS = 10


def fit(model: ArmModel, source: str, terms: str = "") -> Anatomy:
    """Return the anatomy of a model.

    Args:
        model: model of an arm.
        source: name of its file, for the notice.
        terms: first part of the notice.

    Raises:
        HricError: the model has no arm, its coordinates do not match, or no muscle can be used.
    """
    placing = Placing(model)
    lower, upper = _range(placing)
    count = min(SAMPLES, FEWEST_SAMPLES * 2 ** (len(lower) - 1))
    samples = _sampled(placing, model, poses(lower, upper, count + count // SHARE))
    strengths, paths = model.strengths(), placing.muscle_paths()
    credits = f"Fitted from {source}, whose terms hold for it, too. Its credits: {model.credits or 'none in the file'}"
    muscles, errors = dict[str, Muscle](), dict[str, FitError]()
    for k, name in enumerate(model.muscles):
        numbers = [rounded(float(values[k])) for values in strengths]
        made = _fitted(samples, k, placing.joints, name, numbers, paths[k])
        if isinstance(made, str):
            LOG.warning("%s: %s is left out: %s", model.name, name, made)
        else:
            muscles[name], errors[name] = made
            _report_fibres(model.name, made[0], samples, placing.joints)
    acting = [joint for joint in placing.joints if any(joint in muscle.length.joints for muscle in muscles.values())]
    if not acting:
        raise HricError(f"{model.name} has no muscle that can be used: {len(model.muscles)} are left out")
    where = [placing.joints.index(joint) for joint in acting]
    LOG.info("%s: %d of %d muscles act on %s", model.name, len(muscles), len(model.muscles), ", ".join(acting))
    return Anatomy(
        model.name,
        tuple(acting),
        tuple(lower[i] for i in where),
        tuple(upper[i] for i in where),
        muscles,
        {name: rounded(length) for name, length in placing.reference().items()},
        f"{terms} {credits}".strip(),
        errors,
    )


def _range(placing: Placing) -> tuple[list[float], list[float]]:
    """Return the range of the fit: where hinges reach WORKING [rad]. Raises HricError if one does not."""
    lower, upper = list[float](), list[float]()
    for joint in placing.joints:
        low, high = map(math.radians, WORKING[joint])
        if joint in placing.hinges:
            hinge = placing.hinges[joint]
            low, high = max(low, hinge.range[0]), min(high, hinge.range[1])
            if not low < high:
                raise HricError(
                    f"{hinge.coordinate.name} does not reach {joint} from {WORKING[joint][0]:g} to "
                    f"{WORKING[joint][1]:g} deg; its range is {np.degrees(hinge.range).round()} deg there"
                )
        lower.append(low)
        upper.append(high)
    return lower, upper


def _sampled(placing: Placing, model: ArmModel, requested: FloatArray) -> MuscleSamples:
    """Return the samples at reachable poses. Raises HricError if these are fewer than half."""
    q, lengths, arms, pulls = [], [], [], {centre: list[FloatArray]() for centre in CENTRES}
    for n, pose in enumerate(requested):
        if n % (len(requested) // _REPORTS) == 0:
            LOG.info("%s: %d of %d poses", model.name, n, len(requested))
        if not placing.put(pose) or (slopes := placing.slopes(pose)) is None:
            continue
        q.append(pose)
        lengths.append(model.lengths())
        arms.append(-slopes)
        for centre, pull in placing.pulls().items():
            pulls[centre].append(pull)
    if len(q) < len(requested):
        LOG.warning("%s: %d of %d poses are beyond its ranges", model.name, len(requested) - len(q), len(requested))
    if 2 * len(q) < len(requested):
        raise HricError(
            f"{model.name} reaches {len(q)} of {len(requested)} poses of the working range; valid: half of them. Its "
            "coordinates have ranges of another arm, as of a left one"
        )
    return MuscleSamples(
        np.array(q), np.array(lengths), np.array(arms), {centre: np.array(rows) for centre, rows in pulls.items()}
    )


def _fitted(
    samples: MuscleSamples, k: int, joints: tuple[str, ...], name: str, numbers: list[float], path: MusclePath
) -> tuple[Muscle, FitError] | str:
    """Return a muscle and its errors, or the reason why it cannot be used."""
    force, optimal, slack = numbers
    if not (force > 0.0 and optimal > 0.0 and slack >= 0.0):
        return f"{force:g} N, {optimal:g} m of fibres, {slack:g} m of tendon"
    usable = np.isfinite(samples.length[:, k]) & np.isfinite(samples.arms[:, k]).all(axis=1)
    usable &= np.abs(np.nan_to_num(samples.arms[:, k])).max(axis=1) < LONGEST_ARM
    if 1.0 - usable.mean() > MAX_JUMPS:
        return f"its path jumps in {100 * (1.0 - usable.mean()):.0f} % of the poses"
    seen = np.arange(len(usable)) < len(usable) * SHARE // (SHARE + 1)
    if not np.abs(samples.arms[usable & seen, k]).max() > NO_ARM:
        return "it acts on none of these joints"
    made = fit_muscle(samples.part(usable & seen), k, joints, name, force, optimal, slack, path)
    near = np.abs(arm_errors(samples, k, joints, made)).max(axis=1) < FAR_OFF
    if not near[usable & seen].all():
        made = fit_muscle(samples.part(usable & seen & near), k, joints, name, force, optimal, slack, path)
        near = np.abs(arm_errors(samples, k, joints, made)).max(axis=1) < FAR_OFF
    error = fit_error(samples.part(usable & near & ~seen), k, joints, made)
    jumps = 1.0 - float((usable & near).mean())
    if jumps > MAX_JUMPS or error.arm_rms > WORST_FIT:
        return f"its path jumps in {100 * jumps:.0f} % of the poses, beside moment arms missed by {_mm(error)}"
    if jumps > 0.0:
        LOG.warning(
            "%s: its path jumps in %.1f %% of the poses, which are left out; error of the moment arms: %s",
            name,
            100 * jumps,
            _mm(error),
        )
    return made, error


def _mm(error: FitError) -> str:
    return f"{1e3 * error.arm_rms:.1f} mm rms, {1e3 * error.arm_worst:.0f} mm at most"


def _report_fibres(model: str, muscle: Muscle, samples: MuscleSamples, joints: tuple[str, ...]) -> None:
    """Log muscles whose fibres leave their usual range, since nothing is repaired."""
    q = samples.q[:, [joints.index(name) for name in muscle.length.joints]]
    fibres = (muscle.length.values(q) - muscle.slack_length) / muscle.optimal_length
    low, high = float(fibres.min()), float(fibres.max())
    if low < FIBRES[0] or high > FIBRES[1]:
        LOG.warning("%s: fibres of %s go from %.2f to %.2f optimal lengths", model, muscle.name, low, high)
