"""Introduce selected faults into the code one at a time, and show which test fails.

    python3 tests/mutations.py [NAME...]     # all, or the named ones; prints the table of docs/mutations.md

Each change is made in a copy of its package that comes first in PYTHONPATH, so that the workspace is not changed. If a
mutation makes no test fail, the tests have a gap, and the exit code is 1.
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
"""Timeout of the tests of one mutation [s]."""
FAILED = re.compile(r"^(?:FAILED|ERROR) \S*?/(\w+\.py)(?:::(.+?))?(?: - .*)?$", re.MULTILINE)


class MutationError(Exception):
    """A mutation whose line is no longer in the code, or tests that did not run."""


@dataclass(frozen=True)
class Mutation:
    """A fault to introduce into the code.

    Attributes:
        what: description of the fault.
        package: package whose source contains the text to replace.
        before: text to replace, which occurs once in the package.
        after: replacement.
        tests: expression for pytest's -k that selects the tests to run.
        folder: folder of these tests; empty: the test folder of the package.
    """

    what: str
    package: str
    before: str
    after: str
    tests: str
    folder: str = ""


MUTATIONS = {
    "clamp": Mutation(
        "the effort limit does not limit negative torques",
        "hric_control",
        "clamp(tau, -limit.effort, limit.effort)",
        "min(tau, limit.effort)",
        "limits",
    ),
    "jacobian": Mutation(
        "the lever arm of a frame in the Jacobian has the wrong sign",
        "franka_hw_interface",
        "jacobian.changeRefPoint(self.chain.kdl_pose(q, segments).M * offset.p)",
        "jacobian.changeRefPoint(-(self.chain.kdl_pose(q, segments).M * offset.p))",
        "model or chain",
    ),
    "codec": Mutation(
        "the quaternion of a rigid body in a NatNet frame is encoded in the order w x y z",
        "mocap_natnet",
        "tuple([RigidBody(v[0], v[1:4], v[4:8], v[8], v[9])",
        "tuple([RigidBody(v[0], v[1:4], (v[7], *v[4:7]), v[8], v[9])",
        "codec or frame",
    ),
    "state_machine": Mutation(
        "recovery from a reflex leads straight to the idle mode",
        "franka_sim",
        "Event.RECOVER: RobotMode.AUTOMATIC_ERROR_RECOVERY,",
        "Event.RECOVER: RobotMode.IDLE,",
        "box",
    ),
    "lossless_log": Mutation(
        "the control log drops queued messages like any other topic",
        "hric_core",
        "limit = LOSSLESS_LIMIT if lossless else",
        "limit = LAGGING_LIMIT if lossless else",
        "realtime or publish or robot_app",
    ),
    "time": Mutation(
        "the map from one clock to another may run backwards",
        "hric_core",
        "slope = max(line.slope - excess / BEND, SLOWEST * line.slope)",
        "slope = line.slope - excess / BEND",
        "rising_line",
        "src/mocap_natnet/test",
    ),
    "conflict": Mutation(
        "two controllers may claim the same joint",
        "hric_control",
        "if joint in owner and owner[joint] != controller.name:",
        "if joint in owner and owner[joint] == controller.name:",
        "manager or conflict or robot_hw",
    ),
    "steiner": Mutation(
        "an inertia tensor is moved to the centre of mass with the wrong sign of Steiner's term",
        "panda_description",
        'link.inertia + rule["steiner"] * steiner_term',
        'link.inertia - rule["steiner"] * steiner_term',
        "inertia or parameters",
    ),
    "friction": Mutation(
        "the friction force has a component along the contact normal",
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
        "a contact peak between two messages is ignored",
        "hric_assessment",
        "force = np.concatenate([series.force, series.reached[rose], [touch]])",
        "force = np.concatenate([series.force, 0.0 * series.reached[rose], [touch]])",
        "peak_between_two_messages",
    ),
    "guided_speed": Mutation(
        "hand guiding speeds up an arm that is slower than permitted",
        "hric_supervisor",
        "share = min(1.0, settings.guided_speed / self._speed)",
        "share = settings.guided_speed / self._speed",
        "supervisor",
    ),
    "felt": Mutation(
        "the contact force on a hand has the wrong sign if the engine names the hand second",
        "hric_human",
        "else -contact.force",
        "else contact.force",
        "felt",
    ),
    "freedom": Mutation(
        "Student's distribution has one degree of freedom too many",
        "hric_sweep",
        "max(size - 1.0, 1.0)",
        "max(size, 1.0)",
        "rare_events",
    ),
    "lags": Mutation(
        "the correlations of a Markov chain at all lags have the same weight",
        "hric_sweep",
        "(1.0 - k / length) * (float(np.mean",
        "(float(np.mean",
        "rare_events",
    ),
    "drive_speed": Mutation(
        "a position drive has no speed limit",
        "mujoco_ros_control",
        "value = min(max((value - self.q[i]) / step, -limit), limit)",
        "value = (value - self.q[i]) / step",
        "position_drive",
    ),
    "ball_of_water": Mutation(
        "the inertia that the repair gives to a body without one is 1.5 times too large",
        "urdf_to_osim",
        "0.4 * body.mass * radius**2",
        "0.6 * body.mass * radius**2",
        "repair",
    ),
}


def file_of(mutation: Mutation) -> Path:
    """Return the file with the text to replace, relative to the package.

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
    """Copy the package with the mutation into a folder, and return the path for PYTHONPATH."""
    package = folder / mutation.package
    shutil.copytree(ROOT / "src" / mutation.package, package, ignore=shutil.ignore_patterns("test", "__pycache__"))
    file = package / file_of(mutation)
    file.write_text(file.read_text().replace(mutation.before, mutation.after))
    return package / "src"


def run_tests(mutation: Mutation, source: Path | None) -> tuple[int, str]:
    """Run the tests of a mutation with `source` first in PYTHONPATH; return pytest's exit code and output."""
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
    """Return the first test that fails with a mutation; empty: no test fails.

    Raises:
        MutationError: the text to replace is not in the code once, or no test ran.
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
    """Print the table; return 0 if every mutation makes a test fail, else 1."""
    unknown = [name for name in names if name not in MUTATIONS]
    if unknown:
        print(f"unknown mutation: {', '.join(unknown)}; valid: {', '.join(MUTATIONS)}", file=sys.stderr)
        return 2
    print("| mutation | package | fault | first test that fails |\n|---|---|---|---|")
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
