"""Comparison of the measured EMG of a trial with the estimated activation of the same muscles.

The envelope of each channel (`hric_perception.emg.envelope`, without its delay) is compared with the activations that
inverse dynamics and static optimisation of the arms give. These neglect loads in the hands, co-contraction, and the
delay between activation and force.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hric_assessment.ergonomics.muscle_load import load_of
from hric_core.errors import HricError, ParameterError
from hric_core.geometry import FloatArray
from hric_core.parameters import read_yaml
from hric_core.trial.c3d import VOLTS, Trial, read_trial
from hric_human.muscles.after_run import RATE, MuscleLoad
from hric_human.muscles.anatomy import BUILT_IN, load
from hric_motion.marker_sets import EMG, quoted
from hric_motion.moments import JointMoments, intervals
from hric_perception.chunk import Chunk, Layout
from hric_perception.emg.envelope import SHORT_GAP, Envelope, EnvelopeSettings, lag

SETTINGS = EnvelopeSettings(decimate=1)
"""Filters of the envelope: the defaults of the driver."""
TABLE = Path(__file__).parent / "assets" / "emg_muscles.yaml"
SETTLING = 0.25
"""Time after the first sample in which the filters of the envelope settle [s].

The constants of this file are project defaults, unconfirmed."""
SHORTEST = 1.0
"""Smallest time in which envelope and estimate must be known [s]."""
LARGEST_LAG = 0.5
"""Largest delay between estimate and envelope in the search for the best correlation, in both directions [s]."""
CLIPPED = 3
"""Smallest number of successive samples with the largest or smallest value at which a channel counts as clipped."""
SKEW = 0.5
"""Ratio of the sample range below the median to that above it, below which a channel counts as rectified [1]."""
FLAT = 1e-4
"""Standard deviation of the estimated activation below which it counts as constant [1]."""
NO_MUSCLE, MVC, MAXIMUM = "no muscle of the model", "MVC", "maximum in the trial"
WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


class EmgMuscle(NamedTuple):
    """Muscle below an electrode.

    Attributes:
        side: "right" or "left"; "": the channel's label has no side.
        name: name of the muscle.
        lines: names of the muscle's lines of action in the model; empty: the model does not have the muscle.
    """

    side: str
    name: str
    lines: tuple[str, ...]


@dataclass(frozen=True)
class EmgComparison:
    """Measured envelope of a channel and estimated activation of its muscle, at n instants.

    Attributes:
        label: label of the channel.
        muscle: side and name of the muscle; "": not known.
        reason: reason why envelope and estimate are not compared; "": they are.
        reference: divisor of the envelope: MVC, or MAXIMUM, its maximum in the trial; with MAXIMUM, the estimate is
            also divided by its maximum.
        measured: envelope, shape (n,) [1]; NaN: not known.
        estimated: mean activation of the muscle's lines of action, shape (n,) [1]; NaN: not known.
        correlation: Pearson's correlation [1].
        lag: delay of the estimate at which the correlation is largest [s], positive: the estimate is later than the
            envelope; NaN: there is no maximum within LARGEST_LAG.
        best: correlation at this delay [1].
        rms: root mean square difference [1].
    """

    label: str
    muscle: str
    reason: str
    reference: str = ""
    measured: FloatArray = field(default_factory=lambda: np.empty(0))
    estimated: FloatArray = field(default_factory=lambda: np.empty(0))
    correlation: float = np.nan
    lag: float = np.nan
    best: float = np.nan
    rms: float = np.nan


@dataclass(frozen=True)
class TrialEmg:
    """EMG of a trial: times of the comparisons, shape (n,) [s], one comparison for each channel, and remarks."""

    time: FloatArray
    channels: tuple[EmgComparison, ...]
    notes: tuple[str, ...]


@cache
def _table() -> tuple[dict[str, tuple[str, tuple[str, ...]]], dict[str, str], frozenset[str]]:
    """Return emg_muscles.yaml: muscle and its lines by label, side by word, and words in labels that are ignored."""
    tree = read_yaml(TABLE)
    muscles = {
        label: (name, tuple(entry.get("lines", ())))
        for name, entry in tree["muscles"].items()
        for label in entry["labels"]
    }
    sides = {word: side for side, words in tree["sides"].items() for word in words}
    return muscles, sides, frozenset(tree["words"])


def muscle_of(label: str) -> EmgMuscle | None:
    """Return the muscle that a channel's label names; None: the label names no muscle in emg_muscles.yaml."""
    muscles, sides, ignored = _table()
    words = [word.lower() for word in WORD.findall(label)]
    side = next((sides[word] for word in words if word in sides), "")
    key = "".join(word for word in words if word not in ignored and word not in sides)
    if key not in muscles and not side and key:
        ends = {"first": (key[0], key[1:]), "last": (key[-1], key[:-1])}.values()
        side, key = next(
            ((sides[letter], rest) for letter, rest in ends if letter in sides and rest in muscles), ("", key)
        )
    return EmgMuscle(side, *muscles[key]) if key in muscles else None


def read_map(path: Path) -> dict[str, EmgMuscle | None]:
    """Return the section `emg` of a mapping file (--labels): muscle by label; None: the channel is not used.

    Raises:
        ParameterError: the section is not a mapping of labels to muscles, or a muscle is unknown.
    """
    tree = read_yaml(path)
    lines = tree.get(EMG, {}) if isinstance(tree, Mapping) else {}
    if not isinstance(lines, Mapping):
        raise ParameterError(f"{path}: {EMG} is {lines!r}; valid: lines `LABEL: right biceps brachii`")
    mapped = {str(label): muscle_of(str(text)) if text else None for label, text in lines.items()}
    for label, text in lines.items():
        found = mapped[str(label)]
        if text and (found is None or not found.side):
            names = ", ".join(dict.fromkeys(name for name, _ in _table()[0].values()))
            raise ParameterError(f"{path}: {EMG}: {label} is {text!r}; valid: right or left, and one of {names}")
    return mapped


def map_text(trial: Trial) -> str:
    """Return the section `emg` of a new mapping file for the channels of a trial; "": the trial has no EMG."""
    lines = []
    for label, unit in zip(trial.channels, trial.units, strict=True):
        found = muscle_of(label)
        if found is not None or unit.lower() in VOLTS:
            known = f"{found.side} {found.name}" if found is not None and found.side else ""
            lines.append(f"  {quoted(label)}: {quoted(known)}\n")
    return "".join(
        ["# Channel: right or left, and its muscle; without one it is not used.\n", f"{EMG}:\n", *lines]
        if lines
        else []
    )


def compared(
    trial: Trial,
    moments: JointMoments | None,
    mapped: Mapping[str, EmgMuscle | None],
    mvc_files: Sequence[Path] = (),
) -> TrialEmg | None:
    """Compare the EMG channels of a trial with the estimated activations; return None if the trial has no EMG channels.

    Args:
        trial: trial with analog channels.
        moments: joint moments; None: not known.
        mapped: muscles by label in the user's mapping file; None: the channel is not used.
        mvc_files: trials of maximum voluntary contractions, or YAML files with envelopes by label (option --mvc).

    Raises:
        HricError: a file of maximum voluntary contractions cannot be read, or has no channel of the trial.
    """
    muscles = {label: mapped[label] if label in mapped else muscle_of(label) for label in trial.channels}
    named = [label for label in trial.channels if muscles[label] or ("emg" in label.lower() and label not in mapped)]
    mvc, notes = _references(trial, named, mvc_files)
    if not named:
        return None
    estimate = (
        None if moments is None or not any(one and one.lines for one in muscles.values()) else _estimated(moments)
    )
    time = np.empty(0) if moments is None else moments.motion.time
    channels = tuple(_compared(trial, label, muscles[label], estimate, mvc.get(label)) for label in named)
    absent = ", ".join(label for label in mapped if label not in trial.channels)
    others = ", ".join(
        label
        for label, unit in zip(trial.channels, trial.units, strict=True)
        if label not in named and label not in mapped and unit.lower() in VOLTS
    )
    notes += [f"the mapping file names EMG channels that {trial.name} does not have: {absent}"] if absent else []
    notes += [f"analog channels in volts whose labels name no muscle: {others}"] if others else []
    return TrialEmg(trial.start + time, channels, tuple(notes))


def _estimated(moments: JointMoments) -> MuscleLoad:
    """Return the load of the arms' muscles; NaN for an arm at times when a moment of its joints is not known."""
    anatomy, joints = load(BUILT_IN), list(moments.body.joints)
    estimate = load_of(moments.body, anatomy, moments.root, moments.motion, moments.loads)
    lost = {
        side: np.any(np.isnan(moments.moment[:, [joints.index(f"{side}_{joint}") for joint in anatomy.joints]]), axis=1)
        for side in estimate.outside
    }
    return replace(estimate, lost=lost)


def _references(trial: Trial, named: Sequence[str], files: Sequence[Path]) -> tuple[dict[str, float], list[str]]:
    """Return the envelope at maximum contraction by label, in the unit of the trial's channel, and remarks.

    Args:
        trial: trial that is compared.
        named: labels of its EMG channels.
        files: trials of maximum voluntary contractions, or YAML files with envelopes.
    """
    found, notes = dict[str, float](), list[str]()
    for path in files:
        values = _given(path) if path.suffix.lower() in (".yaml", ".yml") else _measured(path, trial, named, notes)
        if not set(values) & set(named):
            raise ParameterError(f"{path} has no EMG channel of {trial.name}; valid: {', '.join(named) or 'none'}")
        for label, value in values.items():
            found[label] = max(value, found.get(label, 0.0))
    return found, notes


def _given(path: Path) -> dict[str, float]:
    """Return the envelopes by label in a YAML file. Raises ParameterError if it has anything else."""
    tree = read_yaml(path)
    if not isinstance(tree, Mapping) or not tree:
        raise ParameterError(f"{path} has no envelopes; valid: lines `LABEL: VALUE`, in the unit of the channel")
    for label, value in tree.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < np.inf:
            raise ParameterError(f"{path}: {label} is {value!r}; valid: a number above 0, in the unit of the channel")
    return {str(label): float(value) for label, value in tree.items()}


def _measured(path: Path, trial: Trial, named: Iterable[str], notes: list[str]) -> dict[str, float]:
    """Return the largest envelope by label in a trial of maximum contractions, in the units of the compared trial.

    Args:
        path: trial of maximum contractions.
        trial: trial that is compared.
        named: labels of the EMG channels of `trial`.
        notes: list of remarks, to which reasons for unusable channels are appended.
    """
    other, values = read_trial(path), dict[str, float]()
    for label in (label for label in named if label in other.channels):
        units = [one.units[one.channels.index(label)].lower() for one in (other, trial)]
        if units[0] != units[1] and not all(unit in VOLTS for unit in units):
            raise ParameterError(
                f"{label} is in {units[0]!r} in {path.name}, in {units[1]!r} in {trial.name}; valid: one unit"
            )
        factor = 1.0 if units[0] == units[1] else VOLTS[units[0]] / VOLTS[units[1]]
        raw = other.analogs[:, other.channels.index(label)]
        if reason := unusable(raw, other.analog_rate):
            notes.append(f"{label} in {path.name} is no maximum voluntary contraction: {reason}")
        else:
            values[label] = factor * float(np.nanmax(envelope(raw, other.analog_rate)[1]))
    return values


def unusable(raw: FloatArray, rate: float) -> str:
    """Return the reason why no envelope can be computed for a channel of raw EMG; "": it can.

    Args:
        raw: samples, shape (n,).
        rate: sample rate [Hz].
    """
    if not np.isfinite(raw).all():
        return f"{(~np.isfinite(raw)).mean():.0%} of its samples are not known"
    if len(raw) < (SETTLING + SHORTEST) * rate:
        return f"it has {len(raw) / rate:.2g} s; valid: {SETTLING + SHORTEST:g} s or more"
    try:
        Envelope(SETTINGS, Layout("", ("",), ("",), rate))
    except HricError as error:
        return str(error)
    if raw.min() == raw.max():
        return "it is a flat line"
    if raw.min() >= 0.0 and _no_raw_signal(raw, rate):
        return "its samples have one sign, as after rectification: raw EMG is needed"
    gap = max((one.stop - one.start for one in intervals(np.diff(raw) == 0.0)), default=0) / rate
    if gap > SHORT_GAP:
        return f"it has a constant value for {gap:.2g} s: samples were lost"
    for end, word in ((raw.min(), "smallest"), (raw.max(), "largest")):
        if any(one.stop - one.start >= CLIPPED for one in intervals(raw == end)):
            return f"it is clipped: {CLIPPED} or more successive samples have the {word} value"
    return ""


def _no_raw_signal(raw: FloatArray, rate: float) -> bool:
    """Return True if a signal cannot be raw EMG: it is not symmetric about its median, or below the filter's band."""
    above = raw - np.median(raw)
    crossings = np.count_nonzero(np.diff(above > 0.0)) * rate / len(raw)
    return bool(-above.min() < SKEW * above.max() or crossings < 2.0 * SETTINGS.band[0])


def envelope(raw: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return times since the first sample [s] and the envelope without its delay, shape (n,) each.

    The envelope has the unit of `raw`, and is NaN while the filters settle.
    """
    layout = Layout("", ("EMG",), ("",), rate)
    chunk = Envelope(SETTINGS, layout).add(Chunk(layout, 0.0, 0, (raw - np.median(raw))[:, None]))
    assert chunk is not None  # without decimation each sample has its envelope
    smooth = np.where(chunk.times < SETTLING, np.nan, np.maximum(chunk.data[:, 0], 0.0))
    return chunk.times - lag(SETTINGS, rate), smooth


def _compared(
    trial: Trial, label: str, muscle: EmgMuscle | None, estimate: MuscleLoad | None, mvc: float | None
) -> EmgComparison:
    """Return the comparison of one channel with the estimate.

    Args:
        trial: trial with the channel.
        label: label of the channel.
        muscle: muscle of the channel; None: not known.
        estimate: load of the arms' muscles; None: not known.
        mvc: envelope at maximum contraction, in the unit of the channel; None: not known.
    """
    if muscle is None or not muscle.lines:
        return EmgComparison(
            label, muscle.name if muscle else "", NO_MUSCLE if muscle else f"{NO_MUSCLE}: its label names none"
        )
    name, index = f"{muscle.side} {muscle.name}".strip(), trial.channels.index(label)
    unit, raw = trial.units[index], trial.analogs[:, index]
    if not muscle.side:
        return EmgComparison(label, name, "its label names no side")
    if unit and unit.lower() not in VOLTS:
        return EmgComparison(label, name, f"its unit is {unit}; valid: V, mV, uV")
    if reason := unusable(raw, trial.analog_rate):
        return EmgComparison(label, name, reason)
    if estimate is None:
        return EmgComparison(label, name, "joint moments are not known")
    columns = [estimate.names.index(f"{muscle.side}_{line}") for line in muscle.lines]
    times, smooth = envelope(raw, trial.analog_rate)
    measured = np.interp(estimate.time, times, smooth, np.nan, np.nan) / (mvc or float(np.nanmax(smooth)))
    known = estimate.known(estimate.names[columns[0]])
    activation = np.where(known, estimate.activation[:, columns].mean(axis=1), np.nan)
    both = np.isfinite(measured) & known
    if both.sum() < SHORTEST * RATE:
        why = "its angles or moments are not known, or outside the range of the muscle paths"
        return EmgComparison(label, name, f"the {muscle.side} arm is known in {both.sum() / RATE:.2g} s: {why}")
    if activation[both].std() < FLAT:
        return EmgComparison(label, name, f"the estimated activation is constant, {activation[both].mean():.3f}")
    activation /= 1.0 if mvc else float(activation[both].max())
    rms = float(np.sqrt(np.mean((activation - measured)[both] ** 2)))
    reference, correlation = MVC if mvc else MAXIMUM, _correlation(measured, activation)
    return EmgComparison(
        label, name, "", reference, measured, activation, correlation, *_lag(measured, activation), rms
    )


def _correlation(measured: FloatArray, estimated: FloatArray) -> float:
    both = np.isfinite(measured) & np.isfinite(estimated)
    return float(np.corrcoef(measured[both], estimated[both])[0, 1])


def _lag(measured: FloatArray, estimated: FloatArray) -> tuple[float, float]:
    """Return the delay of the estimate at which the correlation is largest [s], and this correlation [1].

    Both are NaN if there is no maximum within LARGEST_LAG.
    """
    largest, count = round(LARGEST_LAG * RATE), len(measured)
    steps = [k for k in range(-largest, largest + 1) if count - abs(k) >= SHORTEST * RATE]
    pairs = [(measured[max(0, -k) : count - max(0, k)], estimated[max(0, k) : count - max(0, -k)]) for k in steps]
    enough = [np.isfinite(one + other).sum() >= 0.5 * SHORTEST * RATE for one, other in pairs]
    values = [_correlation(*pair) if valid else -1.0 for pair, valid in zip(pairs, enough, strict=True)]
    best = int(np.argmax(values))
    if best in (0, len(values) - 1) or not (enough[best - 1] and enough[best + 1]):
        return np.nan, np.nan
    return steps[best] / RATE, values[best]


def content(emg: TrialEmg | None) -> dict[str, Any] | None:
    """Return the key `emg` of trial.json; None: the trial has no EMG."""
    if emg is None:
        return None
    numbers = "correlation", "lag", "best", "rms"
    channels = {
        one.label: {key: getattr(one, key) for key in ("muscle", "reason", "reference")}
        | {key: None if np.isnan(value := getattr(one, key)) else value for key in numbers}
        for one in emg.channels
    }
    return {"channels": channels, "notes": list(emg.notes)}


def lines(values: Mapping[str, Any]) -> list[str]:
    """Return sentences on the EMG of a trial; values: content of trial.json."""
    if (emg := values.get("emg")) is None:
        return []
    channels = emg["channels"]
    compared = sum(not one["reason"] for one in channels.values())
    texts = [f"EMG: {compared} of {len(channels)} channels are compared with the estimated activation of their muscle."]
    for label, one in channels.items():
        muscle = f" ({one['muscle']})" if one["muscle"] else ""
        texts.append(f"{label}{muscle}: {_sentence(one)}.")
    if any(one["reference"] == MAXIMUM for one in channels.values()):
        texts.append(
            f"Without an MVC, envelope and estimate are divided by their {MAXIMUM}, which says nothing of effort."
        )
    return [*texts, *emg["notes"]]


def _sentence(one: Mapping[str, Any]) -> str:
    if one["reason"]:
        return f"not compared: {one['reason']}"
    parts = [f"correlation {one['correlation']:.2f}", f"RMS difference {one['rms']:.2f} of the {one['reference']}"]
    if one["lag"] is None:
        return ", ".join([*parts, f"delay not known: the correlation has no maximum within {LARGEST_LAG:g} s"])
    later = "later" if one["lag"] >= 0.0 else "earlier"
    return ", ".join(
        [*parts, f"largest correlation {one['best']:.2f} with the estimate {1e3 * abs(one['lag']):.0f} ms {later}"]
    )
