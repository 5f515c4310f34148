"""Break named things one at a time, and show which test notices.

    python3 tests/mutations.py [NAME...]     # all, or those; the table of docs/mutations.md

Each change is made in a copy of its package that stands before the workspace's own in the path of Python, so that the
workspace is not touched. A mutation that no test notices is a hole in the tests: the exit code is then 1.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT = 900
"""Longest time for the tests of one mutation [s]."""
FAILED = re.compile(r"^(?:FAILED|ERROR) \S*?/(\w+\.py)(?:::(.+?))?(?: - .*)?$", re.MULTILINE)


class MutationError(Exception):
    """A mutation that does not fit the code any more, or tests that did not run."""


@dataclass(frozen=True)
class Mutation:
    """One thing to break.

    Attributes:
        what: is broken, in words.
        package: whose source has the text, in one file.
        before: text that occurs once in the package.
        after: what stands there instead.
        tests: that should notice, as pytest's -k.
        folder: of these tests; empty: that of the package.
    """

    what: str
    package: str
    before: str
    after: str
    tests: str
    folder: str = ""


MUTATIONS = {
    "clamp": Mutation(
        "the limit of effort lets the negative side through",
        "hric_control",
        "clamp(tau, -limit.effort, limit.effort)",
        "min(tau, limit.effort)",
        "limits",
    ),
    "jacobian": Mutation(
        "the tip's lever in the Jacobian has the other sign",
        "franka_hw_interface",
        "jacobian.changeRefPoint(R_root_last * self.T_last_tip.p)",
        "jacobian.changeRefPoint(-(R_root_last * self.T_last_tip.p))",
        "model or chain",
    ),
    "codec": Mutation(
        "a rigid body of a NatNet frame has its quaternion as w x y z",
        "mocap_natnet",
        "tuple([RigidBody(v[0], v[1:4], v[4:8], v[8], v[9])",
        "tuple([RigidBody(v[0], v[1:4], (v[7], *v[4:7]), v[8], v[9])",
        "codec or frame",
    ),
    "state_machine": Mutation(
        "recovery from a reflex leads straight to idle",
        "franka_sim",
        "Event.RECOVER: RobotMode.AUTOMATIC_ERROR_RECOVERY,",
        "Event.RECOVER: RobotMode.IDLE,",
        "box",
    ),
    "lossless_log": Mutation(
        "the control log gives up what waits like any other topic",
        "hric_core",
        "limit = LOSSLESS_LIMIT if lossless else",
        "limit = LAGGING_LIMIT if lossless else",
        "realtime or publish or robot_app",
    ),
    "time": Mutation(
        "the map from one clock to another may turn back",
        "hric_core",
        "slope = max(line.slope - excess / BEND, SLOWEST * line.slope)",
        "slope = line.slope - excess / BEND",
        "rising_line",
        "src/mocap_natnet/test",
    ),
    "conflict": Mutation(
        "two controllers may claim one joint",
        "hric_control",
        "if joint in owner and owner[joint] != controller.name:",
        "if joint in owner and owner[joint] == controller.name:",
        "manager or conflict or robot_hw",
    ),
    "steiner": Mutation(
        "a tensor moves to the centre of mass with the other sign",
        "panda_description",
        'link.inertia + rule["steiner"] * steiner_term',
        'link.inertia - rule["steiner"] * steiner_term',
        "inertia or parameters",
    ),
    "friction": Mutation(
        "the force of friction keeps the part along the normal",
        "hric_control",
        "end = end - (end @ normal) * normal",
        "end = end + (end @ normal) * normal",
        "friction",
    ),
    "envelope": Mutation(
        "EMG is not rectified",
        "hric_perception",
        "np.abs(banded)",
        "banded",
        "envelope or emg",
    ),
    "peak": Mutation(
        "the peak of a contact between two messages does not count",
        "hric_assessment",
        "force = np.concatenate([series.force, series.reached[rose], [touch]])",
        "force = np.concatenate([course.force, 0.0 * series.reached[rose], [touch]])",
        "peak_between_two_messages",
    ),
    "guided_speed": Mutation(
        "guidance speeds an arm up that is slower than it permits",
        "hric_assessment",
        "share = min(1.0, settings.guided_speed / self._speed)",
        "share = settings.guided_speed / self._speed",
        "supervisor",
    ),
    "felt": Mutation(
        "a hand that an engine names second feels the force of the other body",
        "hric_human",
        "else -contact.force",
        "else contact.force",
        "felt",
    ),
    "freedom": Mutation(
        "Student's distribution has a degree of freedom too many",
        "hric_sweep",
        "max(size - 1.0, 1.0)",
        "max(size, 1.0)",
        "rare_events",
    ),
    "lags": Mutation(
        "correlations of a chain all have the same weight",
        "hric_sweep",
        "(1.0 - k / length) * (float(np.mean",
        "(float(np.mean",
        "rare_events",
    ),
    "drive_speed": Mutation(
        "a position drive knows no largest speed",
        "mujoco_ros_control",
        "value = min(max((value - self.q[i]) / step, -limit), limit)",
        "value = (value - self.q[i]) / step",
        "position_drive",
    ),
    "ball_of_water": Mutation(
        "the inertia of a body that a repair invents is half as large again",
        "urdf_to_osim",
        "0.4 * body.mass * radius**2",
        "0.6 * body.mass * radius**2",
        "repair",
    ),
}


def file_of(mutation: Mutation) -> Path:
    """The file with the text to break, relative to the package.

    Raises:
        MutationError: the text does not occur once.
    """
    package = ROOT / "src" / mutation.package
    counts = {path: path.read_text().count(mutation.before) for path in (package / "src").rglob("*.py")}
    having = [path for path, count in counts.items() if count]
    if sum(counts.values()) != 1:
        names = ", ".join(str(path.relative_to(ROOT)) for path in having) or "no file"
        raise MutationError(f"{mutation.before!r} must occur once in {mutation.package}; it is in {names}")
    return having[0].relative_to(package)


def broken(mutation: Mutation, folder: Path) -> Path:
    """A copy of the package with the mutation in it; returns the folder for PYTHONPATH."""
    package = folder / mutation.package
    shutil.copytree(ROOT / "src" / mutation.package, package, ignore=shutil.ignore_patterns("test", "__pycache__"))
    file = package / file_of(mutation)
    file.write_text(file.read_text().replace(mutation.before, mutation.after))
    return package / "src"


def run_tests(mutation: Mutation, source: Path | None) -> tuple[int, str]:
    """pytest's exit code and output for the tests of a mutation; source: comes first in the path, None: as it is."""
    path = os.pathsep.join([*([str(source)] if source else []), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-m", "not slow and not live"]
    done = subprocess.run(
        [*command, "-k", mutation.tests, str(ROOT / (mutation.folder or f"src/{mutation.package}/test"))],
        env={**os.environ, "PYTHONPATH": path},
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def noticed_by(mutation: Mutation) -> str:
    """The test that notices first; empty: none does.

    Raises:
        MutationError: the mutation does not fit, or no test ran.
    """
    with tempfile.TemporaryDirectory(prefix="hric_mutation_") as folder:
        code, output = run_tests(mutation, broken(mutation, Path(folder)))
    if code == 0:
        return ""
    found = FAILED.search(output)
    if code != 1 or found is None:
        raise MutationError(f"the tests of {mutation.package} did not run (code {code}):\n{output[-2000:]}")
    return " ".join(part for part in found.groups() if part)


def main(names: list[str]) -> int:
    """Print the table; 0 when every mutation is noticed."""
    unknown = [name for name in names if name not in MUTATIONS]
    if unknown:
        print(f"no mutation {', '.join(unknown)}; valid: {', '.join(MUTATIONS)}", file=sys.stderr)
        return 2
    print("| mutation | package | what is broken | noticed first by |\n|---|---|---|---|")
    missed = 0
    for name in names or MUTATIONS:
        mutation = MUTATIONS[name]
        test = noticed_by(mutation)
        missed += not test
        print(
            f"| {name} | {mutation.package} | {mutation.what} | {f'`{test}`' if test else '**nothing**'} |", flush=True
        )
    return int(missed > 0)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except MutationError as error:
        sys.exit(f"tests/mutations.py: {error}")
