"""Report text on the simulated human: grips, carried objects, contacts, muscles. All values are model estimates."""

from collections.abc import Sequence

import numpy as np

from hric_analysis.human_difference import HumanDifference
from hric_analysis.human_values import ClampingMetrics, ContactMetrics, Handover, HumanMetrics, TransportMetrics
from hric_analysis.muscle_metrics import MusclesMetrics

SAMPLE = "between two people 2.28 s and 7.3 N in one published sample"
"""Time of joint holding and force in a handover between people, for comparison: the sample in
KTH-RPL/handovers_dataset (MIT)."""
NAMED = 3
"""Number of muscles that the text names: those with the highest activation."""


def render(human: HumanMetrics) -> str:
    """Return the report text on a simulated human."""
    lines = [
        f"human {human.subject} (model estimate): joint torques up to {100 * human.strength_share_max:.0f} % of the "
        f"strength, mean of the most loaded joint {100 * human.strength_share_mean:.0f} %"
    ]
    for name, grip in human.grips.items():
        if grip.force_max is None:
            lines.append(f"- grip {name} never closed: {grip.holder} did not come near {grip.held}")
            continue
        lines.append(
            f"- grip {name} of {grip.held}: {grip.force_max:.1f} N at most, {grip.force_mean:.1f} N in the mean, "
            f"net work {grip.work:+.2f} J, absolute work {grip.work_absolute:.2f} J, slipped "
            f"{1e3 * (grip.slipped or 0.0):.1f} mm ({grip.slips} times)"
        )
    lines += [*map(_handover, human.handovers), *map(_transport, human.carried), *_contacts(human.contacts)]
    lines += muscle_lines(human.muscles) if human.muscles is not None else []
    smooth = "-" if human.hand.smoothness is None else f"{human.hand.smoothness:.2f}"
    lines.append(f"- hand: {human.hand.speed_max:.2f} m/s at most, log dimensionless jerk {smooth}")
    if counts := [f"{name} ({joint.clipped} times)" for name, joint in human.joints.items() if joint.clipped]:
        lines.append(f"- joints that reached their strength limit: {', '.join(counts)}")
    if human.settling is not None:
        lines.append(f"- after the motion: {human.settling.verdict} ({human.settling.decay})")
    return "\n".join(lines)


def _handover(handover: Handover) -> str:
    force = "not known" if handover.force_max is None else f"{handover.force_max:.1f} N"
    end = "THE OBJECT WAS DROPPED" if handover.dropped else "the object was not dropped"
    return (
        f"- {handover.giver} hands {handover.object} over to {handover.taker}: both hold it for "
        f"{handover.overlap:.2f} s, maximum force of {handover.taker} is {force}; {end} ({SAMPLE})"
    )


def _transport(transport: TransportMetrics) -> str:
    parts = [
        f"{name} {100 * share.mean:.1f} % ({100 * share.min:.1f} to {100 * share.max:.1f})"
        for name, share in (transport.load_share or {}).items()
    ]
    shares = f"of its {transport.weight:.1f} N {', '.join(parts)}" if parts else "weight unknown"
    line = (
        f"- both carry {transport.object} for {transport.time:.2f} s: {shares}; internal force up to "
        f"{transport.squeeze_max:.1f} N compression, {transport.stretch_max:.1f} N tension; tilted by "
        f"{np.rad2deg(transport.tilt_max):.1f} deg, lifted by {1e3 * transport.lift:.0f} mm, moved "
        f"{transport.path:.2f} m"
    )
    excess = "" if transport.excess_rms is None else f"; forces equal m (a - g) within {transport.excess_rms:.3f} N RMS"
    return line + excess


def _contacts(contacts: Sequence[ContactMetrics]) -> list[str]:
    """Return the lines on contacts: for each pair of bodies, the strongest contact and the first clamping."""
    pairs: dict[tuple[str, str], list[ContactMetrics]] = {}
    for contact in contacts:
        pairs.setdefault((contact.link, contact.other), []).append(contact)
    lines = []
    for group in pairs.values():
        strongest = max(group, key=lambda contact: (getattr(contact.transient, "peak", 0.0), contact.peak or 0.0))
        clampings = [_clamping(contact.press) for contact in group if contact.press]
        lines += [_contact(strongest), *_expected(strongest), *clampings[:1]]
        if len(group) > 1:
            peak, duration = max(contact.peak or 0.0 for contact in group), sum(contact.duration for contact in group)
            lines.append(f"  {len(group)} contacts, {duration:.3f} s in total" + f", {peak:.1f} N at most" * bool(peak))
    return lines


def _contact(contact: ContactMetrics) -> str:
    bodies = f"{', '.join(contact.regions) or contact.link} touched {contact.other} at {contact.begin:.3f} s"
    if contact.peak is None:
        return f"- {bodies}, rigid contact: no contact force reported"
    return f"- {bodies} for {contact.duration:.3f} s: {contact.peak:.1f} N at most, {contact.impulse:.2f} N s"


def _expected(contact: ContactMetrics) -> list[str]:
    form = contact.transient
    if form is None:
        return []
    return [
        f"  at {form.speed:.3f} m/s with reflected masses of {form.robot_mass:.2f} kg (robot with rotors) and "
        f"{form.human_mass:.2f} kg (human) on {1e-3 * form.stiffness:.0f} N/mm",
        f"  first peak {form.measured_peak:.1f} N, closed form v sqrt(mu k) = {form.peak:.1f} N: ratio "
        f"{form.ratio:.3f}; its half sine {form.duration:.3f} s, {form.impulse:.2f} N s",
    ]


def _clamping(press: ClampingMetrics) -> str:
    return (
        f"  clamped with {press.force:.1f} N at {press.time:.3f} s; commanded torque balances {press.balanced:.1f} N: "
        f"ratio {press.ratio:.3f}"
    )


def muscle_lines(record: MusclesMetrics) -> list[str]:
    """Return the text lines on muscle activation, joint contact forces and saturated muscles."""
    muscles = record.muscles
    strained = sorted(muscles, key=lambda name: -muscles[name].activation_max)[:NAMED]
    names = ", ".join(f"{name} {muscles[name].activation_max:.2f}" for name in strained)
    above = ", ".join(f"above {level} for {100 * share:.0f} % of the time" for level, share in record.above.items())
    lines = [
        f"- muscles: highest activations {names}; mean of all {record.activation_mean:.3f}; at least one muscle {above}"
    ]
    if sizes := [f"{joint} {size.force_max:.0f} N at most" for joint, size in record.contact.items()]:
        lines.append(f"- contact force between bones: {', '.join(sizes)}")
    if counts := [f"{name} ({muscle.limited} times)" for name, muscle in muscles.items() if muscle.limited]:
        lines.append(f"- muscles saturated at maximum strength: {', '.join(counts)}")
    if record.outside > 0.0:
        lines.append(
            f"- for {100 * record.outside:.0f} % of the time the posture was outside the range of the muscle paths; "
            "the paths at the edge of the range were used"
        )
    return lines


def difference_line(difference: HumanDifference) -> str:
    """Return a text line with the joint and the grip that differ most between the humans of two runs."""
    parts = []
    for kind, unit, signals in (("joints", "rad", difference.joints), ("grips", "N", difference.grips)):
        known = {name: signal for name, signal in signals.items() if signal}
        if known:
            name, signal = max(known.items(), key=lambda item: item[1].peak_difference)
            parts.append(
                f"{kind} within {signal.peak_difference:.1e} {unit} ({name}, {signal.peak_time:.3f} s after the start "
                f"of the motion; rms {signal.rms_difference:.1e})"
            )
    return f"human (model estimate): {'; '.join(parts) or 'no joint and no grip in both runs'}"
