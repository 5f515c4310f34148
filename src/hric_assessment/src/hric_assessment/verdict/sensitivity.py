"""Sensitivity of a verdict: the assessment is repeated with each unconfirmed number at both ends of its range.

Only the parts that a number changes are assessed again. The peak force of a simulated impact is not simulated again: it
changes as its closed form v sqrt(mu k), and its energy as mu v^2/2. A force that a sensor measured does not change.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from hric_assessment.ergonomics.scoring import VARIATION, method_of
from hric_assessment.findings import CONTACT, ENERGY, POSTURE, SEPARATION, Finding
from hric_assessment.tables import AREA, LIMITS, TIME_STEP, UncertainNumber, uncertain_table
from hric_assessment.verdict import conclusions
from hric_assessment.verdict.certainty import Certainty, Influence
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.contacts import NOT_VARIED, contact_findings
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import people_of
from hric_assessment.verdict.refined import relative_bar
from hric_assessment.verdict.separating import TOUCHING, PersonSeparation, separated, separation_finding

SHARE, S_P = ("largest share of the limit", "%"), ("protective distance S_p", "m")
"""Quantity and unit of a conclusion; S_p if a distance is not compared with it, as in a contact."""
PEAK, PERMITTED, PROTECTIVE = "transient peak [N]", "permitted speed", "S_p [m]"


class Sensitivity:
    """Sensitivity of the verdict on one recording.

    Args:
        source: recording with the files next to it.
        choices: choices with the contact area that the experiment states.
        separations: distances of the persons from the arm.
    """

    def __init__(
        self, source: AssessmentInput, choices: AssessmentChoices, separations: Sequence[PersonSeparation]
    ) -> None:
        self._source, self._choices, self._separations = source, choices, separations

    def findings(self, group: str, factors: Mapping[str, float]) -> list[Finding]:
        """Return the findings of a group with unconfirmed numbers changed by factors [1].

        group: CONTACT, ENERGY or SEPARATION of `findings`.
        """
        choices = self._choices.varied(factors)
        if group != SEPARATION:
            contacts = contact_findings(self._source, choices)
            return [item for item in contacts if item.group == group and item.share is not None]
        moved = [apart.braked(choices.braking) for apart in self._separations]
        return [replace(separation_finding(apart), share=apart.share) for apart in moved]

    def level(self, question: str, factors: Mapping[str, float]) -> float | None:
        """Return the largest share of the limit [1] with changed numbers; None: no share is known."""
        groups = (CONTACT, ENERGY) if question == conclusions.CONTACT else (SEPARATION,)
        each = [item.share for group in groups for item in self.findings(group, factors)]
        return max((share for share in each if share is not None), default=None)

    @property
    def touching(self) -> bool:
        """True if a person touches the arm, so that the distance cannot be compared with S_p by a ratio."""
        return any(apart.distances.closest.distance <= TOUCHING for apart in self._separations)

    def numbers(self, question: str) -> dict[str, UncertainNumber]:
        """Return the unconfirmed numbers that the conclusion about a question may depend on, by their names."""
        lacking = {AREA} if self._choices.contact_area is None else set()
        table = self._choices.limits.table
        lacking |= {LIMITS} if table.scaled(0.5) == table else set()
        numbers = uncertain_table().numbers
        return {name: item for name, item in numbers.items() if item.changes == question and name not in lacking}

    def certainty(self, question: str, findings: Sequence[Finding]) -> Certainty | None:
        """Return the certainty of the conclusion about contact or distance; None: nothing can be compared with a limit.

        findings: findings of the verdict.
        """
        decisive = conclusions.decisive(question, findings)
        group = "" if decisive is None else decisive.group
        nominal = _worst([item for item in findings if item.group == group])
        if nominal is None or not nominal.values or (nominal.share is None and group != SEPARATION):
            return None
        about = SHARE if nominal.share is not None else S_P
        influences, unknown = [], dict[str, None]()
        for name, number in self.numbers(question).items():
            ends = self._ends(group, name, (number.low, number.high))
            unknown |= dict.fromkeys(NOT_VARIED for _, item in ends if NOT_VARIED in item.notes)
            influences.append(_influence(number.about, uncertain_table().mark_of(number), nominal, ends, about[1]))
        if (bar := relative_bar(nominal)) is not None:
            ends = self._ends(group, TIME_STEP, (1.0 - bar, 1.0 + bar))
            influences.append(
                _influence("numerical error of the peak force", "half time step", nominal, ends, about[1])
            )
        limit = 100.0 if about is SHARE else None
        return Certainty.of(question, (about[0], _value(nominal, about[1]), limit, about[1]), influences, [*unknown])

    def _ends(self, group: str, name: str, factors: Sequence[float]) -> list[tuple[float, Finding]]:
        """Return each factor of a number with the worst finding of a group that has a share of its limit."""
        ends = [(factor, _worst(self.findings(group, {name: factor}))) for factor in factors]
        return [(factor, item) for factor, item in ends if item is not None]


def _worst(findings: Sequence[Finding]) -> Finding | None:
    return max(findings, key=lambda item: item.share or 0.0, default=None)


def _value(finding: Finding, unit: str) -> float:
    """Return the share of the limit [%], or S_p [m]."""
    return 100.0 * (finding.share or 0.0) if unit == SHARE[1] else finding.values.get(PROTECTIVE) or 0.0


def _influence(text: str, mark: str, nominal: Finding, ends: Sequence[tuple[float, Finding]], unit: str) -> Influence:
    first, moved = _quantities(nominal), []
    for factor, item in ends:
        then = _quantities(item)
        effects = {name: then[name] / value - 1.0 for name, value in first.items() if value and name in then}
        moved.append((_value(item, unit) - _value(nominal, unit), factor, effects))
    change, factor, effects = max(
        moved, key=lambda end: (abs(end[0]), *sorted(map(abs, end[2].values()), reverse=True)), default=(0.0, 1.0, {})
    )
    changes = [0.0, *(end[0] for end in moved)]
    return Influence(text, f"x {factor:g}", mark, change, min(changes), max(changes), effects)


def _quantities(finding: Finding) -> dict[str, float]:
    """Return the quantities of a finding that its influences state: peak force, permitted speeds, S_p."""
    values = {PEAK: "peak force", PROTECTIVE: "S_p"}
    values |= {name: name.removesuffix(" [m/s]") for name in finding.values if name.startswith(PERMITTED)}
    return {text: value for name, text in values.items() if (value := finding.values.get(name)) is not None}


def posture_certainty(findings: Sequence[Finding]) -> Certainty | None:
    """Return the certainty of the conclusion about posture, from the scores with shifted thresholds of this project."""
    scored = [item for item in findings if item.group == POSTURE and item.values and method_of(item.subject)]
    decisive = conclusions.decisive(conclusions.POSTURE, scored)
    if decisive is None or (method := method_of(decisive.subject)) is None:
        return None
    score, stricter, looser = (
        decisive.values.get(f"score that counts{end}") or 0.0
        for end in ("", ", chosen thresholds 5 deg smaller", ", chosen thresholds 5 deg larger")
    )
    changes = [stricter - score, looser - score]
    end = "smaller" if abs(changes[0]) >= abs(changes[1]) else "larger"
    about = f"{VARIATION:g} deg {end}"
    low, high = min(0.0, *changes), max(0.0, *changes)
    moved = Influence("posture thresholds", about, "chosen here", max(changes, key=abs), low, high, {})
    return Certainty.of(conclusions.POSTURE, ("score", score, method.table().warning.value, ""), [moved])


def certainties(sensitivity: Sensitivity, findings: Sequence[Finding]) -> tuple[Certainty, ...]:
    """Return the certainty of the conclusions about contact, distance and posture, where it is known.

    findings: findings of the verdict.
    """
    each = [sensitivity.certainty(question, findings) for question in (conclusions.CONTACT, conclusions.DISTANCE)]
    return tuple(item for item in (*each, posture_certainty(findings)) if item is not None)


def doubts(certain: Sequence[Certainty]) -> dict[str, str]:
    """Return the intervals that reach beyond their limits, as sentences by question."""
    return {item.question: item.interval for item in certain if item.doubtful}


def sensitivity_of(source: AssessmentInput, choices: AssessmentChoices | None = None) -> Sensitivity:
    """Return the sensitivity of the verdict on a recording; choices: None: the defaults."""
    choices = (choices or AssessmentChoices()).stated(source.definition)
    each = [separated(source, person, choices) for person in people_of(source)]
    return Sensitivity(source, choices, [apart for apart in each if apart is not None])
