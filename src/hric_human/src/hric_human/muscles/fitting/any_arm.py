"""Fit of the muscles of any arm model: nothing is repaired, and unusable muscles are left out and reported.

    anatomy = any_arm.fit(OpenSimArm(Path("arm26.osim")), "arm26.osim")

If coordinate couplers of the model let a shoulder girdle follow the arm, lengths and moment arms both include the
girdle's motion, as in OpenSim. Joints that the model lacks, or that no muscle of it crosses, get ideal actuators in
`MuscleSet`.
"""

import logging
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.muscles.anatomy import CENTRES, Anatomy, FitError, Muscle, MusclePath
from hric_human.muscles.curves import SampledCurves
from hric_human.muscles.fitting.delft import RANGE, SAMPLES, UNSEEN
from hric_human.muscles.fitting.fit import NO_ARM, arm_errors, fit_error, fit_muscle, rounded
from hric_human.muscles.fitting.model import ArmModel
from hric_human.muscles.fitting.placing import Placing
from hric_human.muscles.fitting.sample import MuscleSamples, poses

LOG = logging.getLogger("hric.human.muscles")
WORKING = {**RANGE, "wr_flex": (-60.0, 60.0), "wr_dev": (-15.0, 25.0)}
"""Range of joint angles of a fit, as far as the model reaches it, by joint [deg]; project default."""
LONGEST_ARM = 0.12
"""Moment arm [m] above which the muscle path is assumed to jump across a bone at that pose; project default."""
MAX_JUMPS = 0.05
"""Maximum share of poses at which the path of a usable muscle may jump across a bone [1]; project default."""
WORST_FIT = 0.006
"""Maximum root mean square error of the moment arms of a usable muscle [m]; project default."""
FAR_OFF = 0.02
"""Error of a fitted moment arm [m] above which the path is assumed to jump at that pose; project default."""
FEWEST_SAMPLES, MAX_SAMPLES = 192, 1024
"""Number of poses of a fit with one joint, doubled for each further joint, and its maximum; project default."""
FIBRES = (0.4, 1.6)
"""Usual range of fibre length per optimal length [1]; muscles that leave it are logged; project default."""
SHARE = SAMPLES // UNSEEN
"""Number of poses used for the fit per pose used to test it."""
PROBES, STILL = 8, 1e-7
"""Number of first poses, and change of a muscle's length between them below which the arm does not move it [m]."""
EARLY = 64
"""Number of poses after which a model is refused if it reached fewer than a quarter of them; project default."""
_REPORTS = 10


def fit(model: ArmModel, source: str, terms: str = "") -> Anatomy:
    """Fit the muscles of an arm model.

    Args:
        model: model of an arm.
        source: name of the model's file, for the notice.
        terms: licence notice, which precedes the source in the anatomy's notice.

    Raises:
        HricError: the model has no arm, its coordinates do not match the joints of an arm, or no muscle can be used.
    """
    placing = Placing(model)
    lower, upper = _range(placing)
    count = min(MAX_SAMPLES, FEWEST_SAMPLES * 2 ** (len(lower) - 1))
    curves = _curves(model, _acting(placing, model, poses(lower, upper, PROBES)))
    samples = _sampled(placing, model, poses(lower, upper, count + count // SHARE))
    strengths, paths = model.strengths(), placing.muscle_paths()
    credits = f"Fitted from {source}, whose licence applies here. Its credits: {model.credits or 'none in the file'}"
    muscles, errors = dict[str, Muscle](), dict[str, FitError]()
    for k, name in enumerate(model.muscles):
        numbers = [rounded(float(values[k])) for values in strengths]
        own = curves[k]
        made = own if isinstance(own, str) else _fitted(samples, k, placing.joints, name, numbers, paths[k])
        if isinstance(own, str) or isinstance(made, str):
            LOG.warning("%s: muscle %s is left out: %s", model.name, name, made)
        else:
            muscles[name], errors[name] = replace(made[0], curves=own), made[1]
            _report_fibres(model.name, made[0], samples, placing.joints)
    acting = [joint for joint in placing.joints if any(joint in muscle.length.joints for muscle in muscles.values())]
    if not acting:
        raise HricError(f"{model.name} has no usable muscle: all {len(model.muscles)} are left out, see the log")
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


def _acting(placing: Placing, model: ArmModel, requested: FloatArray) -> list[bool]:
    """Return True for muscles whose length changes between poses. Raises HricError: the arm moves no muscle."""
    lengths = list[FloatArray]()
    for pose in requested:
        placing.put(pose)  # a pose that is reached in part moves the arm, too
        lengths.append(model.lengths())
    acting = [bool(moved) for moved in ~(np.ptp(lengths, axis=0) < STILL)]  # True: a length is not finite
    if not any(acting):
        raise HricError(
            f"{model.name} has no muscle of the right arm: none of its {len(acting)} muscles changes its length when "
            f"{', '.join(placing.joints)} move; its first muscles: {', '.join(model.muscles[:_REPORTS])}"
        )
    return acting


def _curves(model: ArmModel, acting: Sequence[bool]) -> Sequence[SampledCurves | str | None]:
    """Return for each muscle its curves, the reason why it cannot be used, or None for the built-in curves.

    Raises:
        HricError: half or more of the muscles that act on the arm cannot be used.
    """
    curves = list[SampledCurves | str | None](model.curves())
    for k, values in enumerate(zip(*model.strengths(), strict=True)):
        if not (min(values[:2]) > 0.0 and values[2] >= 0.0 and np.isfinite(values).all()):
            curves[k] = (
                f"its strength is {values[0]:g} N, its fibres are {values[1]:g} m long, its tendon {values[2]:g} m; "
                "valid: strength and fibres above 0, tendon 0 or more"
            )
    named = zip(model.muscles, curves, acting, strict=True)
    unusable = [f"{name}: {reason}" for name, reason, acts in named if acts and isinstance(reason, str)]
    if 2 * len(unusable) >= sum(acting):
        raise HricError(
            f"{model.name}: {len(unusable)} of the {sum(acting)} muscles of the arm cannot be used; the first is "
            f"{unusable[0]}"
        )
    return curves


def _range(placing: Placing) -> tuple[list[float], list[float]]:
    """Return the lower and upper joint angles of the fit [rad]: WORKING, limited to what hinges of the model reach.

    Raises:
        HricError: a hinge reaches no angle of its range in WORKING.
    """
    lower, upper = list[float](), list[float]()
    for joint in placing.joints:
        low, high = map(math.radians, WORKING[joint])
        if joint in placing.hinges:
            hinge = placing.hinges[joint]
            low, high = max(low, hinge.range[0]), min(high, hinge.range[1])
            if not low < high:
                raise HricError(
                    f"{hinge.coordinate.name} does not reach {joint} from {WORKING[joint][0]:g} to "
                    f"{WORKING[joint][1]:g} deg; its range corresponds to {joint} {np.degrees(hinge.range).round()} deg"
                )
        lower.append(low)
        upper.append(high)
    return lower, upper


def _sampled(placing: Placing, model: ArmModel, requested: FloatArray) -> MuscleSamples:
    """Sample the muscles at those requested poses, shape (n, m) [rad], that the model reaches.

    Raises:
        HricError: the model reaches fewer than half of the poses.
    """
    q, lengths, arms = list[FloatArray](), list[FloatArray](), list[FloatArray]()
    pulls = {centre: list[FloatArray]() for centre in CENTRES}
    for n, pose in enumerate(requested):
        if n == EARLY and 4 * len(q) < EARLY:
            requested = requested[:EARLY]
            break
        if n % (len(requested) // _REPORTS) == 0:
            LOG.info("%s: %d of %d poses sampled", model.name, n, len(requested))
        if not placing.put(pose) or (slopes := placing.slopes(pose)) is None:
            continue
        q.append(pose)
        lengths.append(model.lengths())
        arms.append(-slopes)
        for centre, pull in placing.pulls().items():
            pulls[centre].append(pull)
    if len(q) < len(requested):
        LOG.warning(
            "%s: %d of %d poses are outside the model's coordinate ranges and are left out",
            model.name,
            len(requested) - len(q),
            len(requested),
        )
    if 2 * len(q) < len(requested):
        raise HricError(
            f"{model.name} reaches {len(q)} of {len(requested)} poses of the working range; valid: half of them or "
            "more. Its coordinate ranges may be those of another arm, for instance of a left one"
        )
    return MuscleSamples(
        np.array(q), np.array(lengths), np.array(arms), {centre: np.array(rows) for centre, rows in pulls.items()}
    )


def _fitted(
    samples: MuscleSamples, k: int, joints: tuple[str, ...], name: str, numbers: list[float], path: MusclePath
) -> tuple[Muscle, FitError] | str:
    """Fit the muscle with index k in the samples; return it with its errors, or the reason why it cannot be used.

    numbers: maximum isometric force [N], optimal fibre length [m], tendon slack length [m].
    """
    force, optimal, slack = numbers
    usable = np.isfinite(samples.length[:, k]) & np.isfinite(samples.arms[:, k]).all(axis=1)
    usable &= np.abs(np.nan_to_num(samples.arms[:, k])).max(axis=1) < LONGEST_ARM
    if 1.0 - usable.mean() > MAX_JUMPS:
        return f"its path jumps across a bone at {100 * (1.0 - usable.mean()):.0f} % of the poses"
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
        return f"its path jumps across a bone at {100 * jumps:.0f} % of the poses; moment arm error: {_mm(error)}"
    if jumps > 0.0:
        LOG.warning(
            "%s: its path jumps across a bone at %.1f %% of the poses, which are left out; moment arm error: %s",
            name,
            100 * jumps,
            _mm(error),
        )
    return made, error


def _mm(error: FitError) -> str:
    return f"{1e3 * error.arm_rms:.1f} mm rms, {1e3 * error.arm_worst:.0f} mm at most"


def _report_fibres(model: str, muscle: Muscle, samples: MuscleSamples, joints: tuple[str, ...]) -> None:
    """Log a warning if the muscle's fibres leave their usual range FIBRES, since nothing is repaired."""
    q = samples.q[:, [joints.index(name) for name in muscle.length.joints]]
    fibres = (muscle.length.values(q) - muscle.slack_length) / muscle.optimal_length
    low, high = float(fibres.min()), float(fibres.max())
    if low < FIBRES[0] or high > FIBRES[1]:
        LOG.warning(
            "%s: the fibre length of %s ranges from %.2f to %.2f optimal lengths; usual: %.1f to %.1f",
            model,
            muscle.name,
            low,
            high,
            *FIBRES,
        )
