"""Text report of a run, for the terminal and summary.txt."""

from collections import Counter
from collections.abc import Mapping, Sequence

from hric_analysis import stability
from hric_analysis.metrics import JointMetrics, SetpointMetrics
from hric_analysis.supervised import SupervisorMetrics
from hric_analysis.values import RunMetrics
from hric_assessment import DISCLAIMER
from hric_bags import text
from hric_bags.records import contact_record
from hric_bags.run_file import RunFile
from hric_report import sensor_text

PEAKS = (("|tau| max", "N m"), ("rotatum max", "N m/s"), ("|dq| max", "rad/s"), ("of limit", ""))
"""Columns of the peaks of a joint over a run, with their units."""
SHOWN_EVENTS = 12
"""Maximum number of supervisor events in the text; metrics.json has all of them. Project default, unconfirmed."""


def render(run: RunFile, metrics: RunMetrics) -> str:
    """Return the complete text report of a run; `run`: contents of run.yaml."""
    parts = [_head(run, metrics)]
    parts += [
        f"THE ARM PROTECTED ITSELF at {reflex.time:.3f} s: {', '.join(reflex.errors)}" for reflex in metrics.reflexes
    ]
    if metrics.prismatic:
        parts.append(prismatic(metrics.prismatic))
    parts.append(_stability(metrics.stability))
    one = len(metrics.setpoints) == 1
    parts += [_setpoint(setpoint, metrics.joints if one else {}) for setpoint in metrics.setpoints]
    if metrics.setpoints and not one:
        rows = [[name, *_peaks(joint)] for name, joint in metrics.joints.items()]
        lines = text.rows([*zip(("joint", ""), *PEAKS, strict=True), *rows], head=2)
        parts.append("\n".join(["peaks over the whole run", "", *lines]))
    if metrics.human:
        from hric_report import human_text  # imported only for runs with a person: it is slow to import

        parts.append(human_text.render(metrics.human))
    if metrics.supervisor:
        parts.append(_supervisor(metrics.supervisor))
    if metrics.tracking:
        parts.append(sensor_text.tracking(metrics.tracking))
    elif not metrics.setpoints and not metrics.human:
        parts.append("no setpoint was recorded")
    if metrics.contacts:
        lines = text.rows([contact_record.HEAD, *contact_record.cells(metrics.contacts)])
        parts.append("\n".join([*lines, *filter(None, [contact_record.note(metrics.contacts)])]))
    parts += [_held(name, force) for name, force in (metrics.forces or {}).items()]
    parts += [_limits(metrics), _log(metrics)]
    if metrics.sources:
        parts.append(sensor_text.collection(metrics.sources, metrics.sync or {}))
    if metrics.reference and metrics.differences:
        lines = [f"differences from {metrics.reference.title}:"]
        for item in metrics.differences:
            lines += [f"- {item.what}: reference {item.reference}; this run {item.here}", f"  {item.why}"]
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _head(run: RunFile, metrics: RunMetrics) -> str:
    arguments = " ".join(run.get("arguments") or []) or "none"
    rtf = run.get("real_time_factor")
    pace = f", {rtf:.2f} times real time" if isinstance(rtf, int | float) else ""
    if metrics.missed_deadlines is not None:
        pace += f", {metrics.missed_deadlines} deadlines missed"
    log = metrics.control_log
    error = f": {reason}" if (reason := run.get("error") or run.get("reason")) else ""
    return (
        f"{run.get('experiment', 'run')}: {run.get('description', '')}\n"
        f"{run.get('status', '')} ({run.get('mode', '')}){error}, arguments: {arguments}, seed {run.get('seed', 0)}\n"
        f"{log.cycles} cycles, {log.duration:.3f} s of robot time{pace}"
    )


def prismatic(joints: Sequence[str]) -> str:
    """Return a sentence on the units of prismatic joints, whose values are in columns with units of revolute joints."""
    return f"{', '.join(joints)}: prismatic; units are m, m/s, N and N/s instead of rad, rad/s, N m and N m/s"


def _held(name: str, force: contact_record.ForceHeld) -> str:
    contact = force.contact_rms_error
    known = "not recorded" if contact is None else f"{contact:.3f} N"
    return (
        f"{name.lstrip('/')}: {force.desired:.2f} N desired for {force.seconds:.2f} s; RMS error of the contact force "
        f"{known}, of the estimated force {force.estimate_rms_error:.3f} N"
    )


def _stability(judged: stability.Stability) -> str:
    if judged.verdict is None:
        return "stability: not judged, the run is too short"
    if judged.verdict == stability.STABLE:
        return "stability: stable"
    return "\n".join(["stability: UNSTABLE", *(f"- {reason}" for reason in judged.reasons)])


def setpoint_cells(setpoint: SetpointMetrics) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """Return the table of one setpoint: (name, unit) of each column, and one row per joint, its name first."""
    tolerances = list(setpoint.settling_time_max)
    columns = [("joint", ""), ("start", "rad"), ("setpoint", "rad"), ("final error", "rad")]
    columns += [*((f"settled {t}", "s") for t in tolerances), ("overshoot", "rad")]
    rows = [
        [
            name,
            f"{joint.start:.4f}",
            f"{joint.target:.4f}",
            f"{joint.final_error:.2e}",
            *("never" if (time := joint.settling_time[t]) is None else f"{time:.3f}" for t in tolerances),
            f"{joint.overshoot:.2e}",
        ]
        for name, joint in setpoint.joints.items()
    ]
    return columns, rows


def _peaks(joint: JointMetrics) -> list[str]:
    """Return the cells of the columns PEAKS."""
    peaks = (joint.effort_peak, joint.rotatum_peak, joint.velocity_peak)
    share = "-" if joint.velocity_ratio is None else f"{100 * joint.velocity_ratio:.0f} %"
    return [*("-" if peak is None else f"{peak:.2f}" for peak in peaks), share]


def _setpoint(setpoint: SetpointMetrics, joints: Mapping[str, JointMetrics]) -> str:
    """Return the table of one setpoint; joints: those whose peaks over the run belong to it."""
    columns, rows = setpoint_cells(setpoint)
    if joints:
        columns, rows = [*columns, *PEAKS], [[*row, *_peaks(joints[row[0]])] for row in rows]
    lines = text.rows([*zip(*columns, strict=True), *rows], head=2)
    bands = ", ".join(
        f"within {t} rad {'never' if time is None else f'after {time:.3f} s'}"
        for t, time in setpoint.settling_time_max.items()
    )
    title = (
        f"setpoint at {setpoint.time:.3f} s through {setpoint.controller}: largest final error "
        f"{setpoint.final_error_max:.2e} rad"
    )
    return "\n".join([f"{title}; all joints {bands}", "", *lines])


def _limits(metrics: RunMetrics) -> str:
    touched = metrics.limits_touched
    if touched is None:
        return "limits: the robot published no counts of limited cycles"
    changed = [f"{name} {joint.command_change:.2g}" for name, joint in metrics.joints.items() if joint.command_change]
    if not any(touched.values()):
        lines = [] if changed else ["limits: no limit acted"]
    else:
        counts = ", ".join(f"{kind} {count}" for kind, count in touched.items())
        lines = [f"limits acted (cycles, summed over the joints): {counts}", *_limited(metrics.joints)]
    if changed:
        lines.append(
            "limits, such as those of acceleration and jerk, changed commands of position [rad] or velocity [rad/s] "
            f"by up to: {', '.join(changed)}"
        )
    if outside := ", ".join(
        f"{name} (at most {joint.position_excess_max:.4f} rad outside)"
        for name, joint in metrics.joints.items()
        if joint.started_outside
    ):
        lines.append(f"started outside the position range: {outside}")
    return "\n".join(lines)


def _limited(joints: Mapping[str, JointMetrics]) -> list[str]:
    cells = [["joint", "position", "velocity", "effort", "rotatum", "|dq| / limit", "outside [rad]"]]
    for name, joint in joints.items():
        if counts := joint.limited_cycles:
            row = [str(counts[kind]) for kind in ("position", "velocity", "effort", "effort_rate")]
            cells.append([name, *row, f"{joint.velocity_ratio_max:.3f}", f"{joint.position_excess_max:.4f}"])
    return text.rows(cells)


def _log(metrics: RunMetrics) -> str:
    log = metrics.control_log
    if log.missing_cycles or log.repeated_cycles:
        return (
            f"control log: {log.missing_cycles} cycles MISSING in {len(log.gaps)} gaps, {log.repeated_cycles} repeated"
        )
    start = f" from cycle {log.first_cycle} on" if log.first_cycle else ""
    return f"control log: every cycle recorded once{start}, state_sha256 {metrics.state_sha256[:16]}"


UNJUDGED = {"moved": "something else than its controllers moved it", "fault": "a fault made the distance unknown"}
"""Clause on the time after an event in which the supervisor judges no motion, by the kind of the event."""


def unjudged(supervisor: SupervisorMetrics) -> str:
    """Return a clause on the time in which the supervisor judged no motion; empty if there is none."""
    kinds = {event.kind for event in supervisor.events}
    return " or ".join(clause for kind, clause in UNJUDGED.items() if kind in kinds)


def violations(supervisor: SupervisorMetrics) -> str:
    """Return a sentence on the time for which the arm moved closer to the person than the protective distance."""
    if not supervisor.violations:
        time = unjudged(supervisor)
        unless = f", except perhaps while {time}" if time else ""
        return f"the arm never moved closer than the protective distance{unless}"
    duration = sum(interval.end - interval.begin for interval in supervisor.violations)
    return (
        f"THE ARM MOVED CLOSER THAN THE PROTECTIVE DISTANCE for {duration:.2f} s ({len(supervisor.violations)} times), "
        f"by up to {-(supervisor.margin_min_violated or 0.0):.3f} m"
    )


def _supervisor(supervisor: SupervisorMetrics) -> str:
    nearest, late = supervisor.separation_min, supervisor.latency
    distance = "distance not known" if nearest is None else f"smallest distance {nearest:.3f} m"
    if nearest is not None and supervisor.share_unknown:
        distance += f" where it was known, not for {100.0 * supervisor.share_unknown:.1f} % of the time"
    lines = [
        f"supervisor, {supervisor.mode}: stopped for {100.0 * supervisor.share_stopped:.1f} % of the time, slowed for "
        f"{100.0 * supervisor.share_slowed:.1f} %; {distance}; {violations(supervisor)}"
    ]
    if late.median is not None and late.p99 is not None:
        lines.append(
            f"- delay from a measured pose to the cycle that applied the request: median {1e3 * late.median:.1f} ms, "
            "99 % "
            f"{1e3 * late.p99:.1f} ms"
        )
    events = supervisor.events
    lines += [f"- {event.time:.3f} s {event.kind}: {event.text}" for event in events[:SHOWN_EVENTS]]
    if others := Counter(event.kind for event in events[SHOWN_EVENTS:]):
        lines.append("- and " + ", ".join(f"{count} {kind}" for kind, count in others.items()))
    return "\n".join([*lines, DISCLAIMER])
