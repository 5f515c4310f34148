"""Text of a report, for the terminal and summary.txt."""

from collections.abc import Mapping, Sequence
from typing import Any

from hric_analysis import collection, human, stability, supervised, tracking
from hric_bags import text
from hric_bags.records import contact_record


def render(run: Mapping[str, Any], metrics: Mapping[str, Any]) -> str:
    """Return the text of the complete report.

    Args:
        run: contents of run.yaml.
        metrics: contents of metrics.json.
    """
    parts = [_head(run, metrics)]
    parts += [
        f"THE ARM PROTECTED ITSELF at {one['time']:.3f} s: {', '.join(one['errors'])}"
        for one in metrics.get("reflexes", ())
    ]
    parts.append(_stability(metrics["stability"]))
    parts += [_move(move, metrics["joints"]) for move in metrics["setpoints"]]
    if metrics.get("human"):
        parts.append(human.render(metrics["human"]))
    if metrics.get("supervisor"):
        parts.append(supervised.render(metrics["supervisor"]))
    if metrics.get("tracking"):
        parts.append(tracking.render(metrics["tracking"]))
    elif not metrics["setpoints"] and not metrics.get("human"):
        parts.append("no setpoint was recorded")
    if metrics.get("contacts"):
        parts.append(_contacts(metrics["contacts"]))
    parts += [_limits(metrics), _log(metrics)]
    if metrics.get("sources"):
        parts.append(collection.render(metrics))
    if metrics.get("differences"):
        parts.append(_differences(metrics))
    return "\n\n".join(parts) + "\n"


def _head(run: Mapping[str, Any], metrics: Mapping[str, Any]) -> str:
    arguments = " ".join(run.get("arguments") or []) or "none"
    rtf = run.get("real_time_factor")
    pace = f", {rtf:.2f} times real time" if isinstance(rtf, int | float) else ""
    if (missed := metrics.get("missed_deadlines")) is not None:
        pace += f", {missed} deadlines missed"
    cycles = metrics["control_log"]
    error = f": {reason}" if (reason := run.get("error") or run.get("reason")) else ""
    return (
        f"{run.get('experiment', 'run')}: {run.get('description', '')}\n"
        f"{run.get('status', '')} ({run.get('mode', '')}){error}, arguments: {arguments}, seed {run.get('seed', 0)}\n"
        f"{cycles['cycles']} cycles, {cycles['duration']:.3f} s of robot time{pace}"
    )


def _stability(found: Mapping[str, Any]) -> str:
    if found["verdict"] is None:
        return "stability: not judged, the run is too short"
    if found["verdict"] == stability.STABLE:
        return "stability: stable"
    return "\n".join(["stability: UNSTABLE", *(f"- {reason}" for reason in found["reasons"])])


def setpoint_cells(move: Mapping[str, Any]) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """Return the table of one setpoint: (name, unit) of each column, and a row per joint with its name first.

    Args:
        move: entry of `setpoints` in metrics.json.
    """
    tolerances = list(move["settling_time_max"])
    columns = [("joint", ""), ("start", "rad"), ("setpoint", "rad"), ("final error", "rad")]
    columns += [*((f"settled {t}", "s") for t in tolerances), ("overshoot", "rad")]
    rows = [
        [
            name,
            f"{joint['start']:.4f}",
            f"{joint['target']:.4f}",
            f"{joint['final_error']:.2e}",
            *("never" if (time := joint["settling_time"][t]) is None else f"{time:.3f}" for t in tolerances),
            f"{joint['overshoot']:.2e}",
        ]
        for name, joint in move["joints"].items()
    ]
    return columns, rows


def _move(move: Mapping[str, Any], peaks: Mapping[str, Any]) -> str:
    columns, rows = setpoint_cells(move)
    columns += [("|tau| max", "N m"), ("rotatum max", "N m/s"), ("|dq| max", "rad/s"), ("of limit", "")]
    for row in rows:
        peak = peaks[row[0]]
        row += [f"{peak[key]:.2f}" if key in peak else "-" for key in ("effort_peak", "rotatum_peak", "velocity_peak")]
        row.append("-" if (ratio := peak.get("velocity_ratio")) is None else f"{100 * ratio:.0f} %")
    lines = text.rows([*zip(*columns, strict=True), *rows], head=2)
    bands = ", ".join(
        f"within {t} rad {'never' if time is None else f'after {time:.3f} s'}"
        for t, time in move["settling_time_max"].items()
    )
    title = (
        f"setpoint at {move['time']:.3f} s through {move['controller']}: largest final error "
        f"{move['final_error_max']:.2e} rad"
    )
    return "\n".join([f"{title}; all joints {bands}", "", *lines])


def _contacts(found: Sequence[Mapping[str, Any]]) -> str:
    lines, note = text.rows([contact_record.HEAD, *contact_record.cells(found)]), contact_record.note(found)
    return "\n".join([*lines, note] if note else lines)


def _limits(metrics: Mapping[str, Any]) -> str:
    touched = metrics["limits_touched"]
    if touched is None:
        return "limits: the robot published no counts"
    if not any(touched.values()):
        text = "limits: none was touched"
    else:
        text = "limits acted (cycles, summed over the joints): " + ", ".join(
            f"{kind} {count}" for kind, count in touched.items()
        )
        text += "\n" + "\n".join(_limited(metrics["joints"]))
    outside = [name for name, joint in metrics["joints"].items() if joint.get("started_outside")]
    if outside:
        excess = ", ".join(
            f"{name} (at most {metrics['joints'][name]['position_excess_max']:.4f} rad outside)" for name in outside
        )
        text += f"\nstarted outside the position range: {excess}"
    return text


def _limited(joints: Mapping[str, Any]) -> list[str]:
    cells = [["joint", "position", "velocity", "effort", "rotatum", "|dq| of limit", "outside [rad]"]]
    for name, joint in joints.items():
        counts = joint.get("limited_cycles")
        if counts:
            row = [str(counts[kind]) for kind in ("position", "velocity", "effort", "effort_rate")]
            cells.append([name, *row, f"{joint['velocity_ratio_max']:.3f}", f"{joint['position_excess_max']:.4f}"])
    return text.rows(cells)


def _log(metrics: Mapping[str, Any]) -> str:
    log = metrics["control_log"]
    if log["missing_cycles"] or log["repeated_cycles"]:
        return (
            f"control log: {log['missing_cycles']} cycles MISSING in {len(log['gaps'])} gaps, "
            f"{log['repeated_cycles']} repeated"
        )
    start = f" from cycle {log['first_cycle']} on" if log["first_cycle"] else ""
    return f"control log: every cycle once{start}, state_sha256 {metrics['state_sha256'][:16]}"


def _differences(metrics: Mapping[str, Any]) -> str:
    lines = [f"differences from {metrics['reference']['title']}:"]
    for item in metrics["differences"]:
        lines += [f"- {item['what']}: there {item['reference']}; here {item['here']}", f"  {item['why']}"]
    return "\n".join(lines)
