"""What `rosrun hric_human fit_muscles` does."""

from pathlib import Path

from hric_human.muscles.anatomy import Anatomy
from hric_human.muscles.fitting import delft


def run(model: Path, output: Path) -> None:
    """Fit das4_v4.osim, write the file of the anatomy, and print its notice and its errors. Raises HricError."""
    anatomy = delft.fit(model)
    anatomy.save(output)
    print(anatomy.notice)
    print(table(anatomy))


def table(anatomy: Anatomy) -> str:
    """Muscles with their numbers and errors of the fit, as Markdown."""
    rows = [
        "| muscle | force N | optimal mm | tendon mm | joints | length rms mm | arm rms mm | single mm | pull worst |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, muscle in anatomy.muscles.items():
        error = anatomy.errors[name]
        pull = max(error.pull_worst.values(), default=0.0)
        numbers = 1e3 * muscle.optimal_length, 1e3 * muscle.slack_length
        errors = 1e3 * error.length_rms, 1e3 * error.arm_rms, 1e3 * error.arm_worst
        rows.append(
            f"| {name} | {muscle.max_force:.0f} | {numbers[0]:.1f} | {numbers[1]:.1f} | {len(muscle.length.joints)} | "
            + " | ".join(f"{value:.2f}" for value in (*errors, pull))
            + " |"
        )
    return "\n".join(rows)
