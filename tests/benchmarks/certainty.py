"""Check what a verdict says of its certainty against further simulations of `try_contact` at several speeds.

    python tests/benchmarks/certainty.py reruns    # predicted peak forces with a number changed, against 20 reruns
    python tests/benchmarks/certainty.py bars      # error bars of 20 runs with a twin, against an eighth of the step

A rerun has the changed number in the simulated arm or person. The bars are those of `hric run --refine`: they follow
from a twin with half the time step.
"""

import argparse
from collections.abc import Iterator
from typing import NamedTuple

import panda_description
from hric_assessment.findings import CONTACT
from hric_assessment.tables import ROTORS, STIFFNESS
from hric_assessment.verdict.assess import judge
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.refined import refinement
from hric_assessment.verdict.sensitivity import sensitivity_of
from hric_human.body.regions import REGION_MODELS
from hric_run.simulation import Simulation
from hric_sweep.observed import Observed

LINK, REGION = "human::r_elbow", "lower arm, wrist"
"""Link of the forearm, which the arm hits, and its region."""
PEAK, SPEED = "transient peak [N]", "speed at contact [m/s]"
SPEEDS = (0.9, 1.1, 1.3, 1.5, 1.7)
"""Speeds of the reruns: parameter profile.velocity of the controller [rad/s]."""
ALL_SPEEDS = tuple(round(0.8 + 0.1 * k, 1) for k in range(10))
CHANGES = ((STIFFNESS, 0.7), (STIFFNESS, 1.4), (ROTORS, 0.5), (ROTORS, 2.0))
STEP, DURATION = 1e-3, 0.8
"""Time step of the engines, and duration of a simulation [s]."""


class Blow(NamedTuple):
    """Largest peak force of a simulation [N], and the speed at which arm and person met [m/s]."""

    peak: float
    speed: float


def simulated(engine: str, velocity: float, plant: dict[str, object]) -> AssessmentInput:
    """Return a simulation of try_contact; plant: settings of the plant that are changed."""
    values = {f"robot.plant.{name}": value for name, value in plant.items()}
    changed = {"simulator": engine, "parameters.joint_pd_controller.profile.velocity": velocity, **values}
    with Simulation("try_contact", **changed) as simulation:
        observed = Observed(simulation, {"human", "contacts", "impact"})
        simulation.run(DURATION)
        return observed.values().verdict_input


def largest(source: AssessmentInput, factors: dict[str, float]) -> Blow:
    """Return the largest peak that the verdict states, with numbers changed by factors."""
    findings = sensitivity_of(source).findings(CONTACT, factors)
    worst = max(findings, key=lambda item: item.values.get(PEAK) or 0.0)
    return Blow(worst.values[PEAK] or 0.0, worst.values[SPEED] or 0.0)


def in_plant(name: str, factor: float) -> dict[str, object]:
    """Return the settings of the plant with a number changed by a factor."""
    if name == ROTORS:
        return {"rotor_inertia": [factor * value for value in panda_description.rotor_inertia()]}
    stiffness = factor * REGION_MODELS[REGION].stiffness
    return {"surfaces": [{"link": LINK, "contact": "penalty", "stiffness": stiffness}]}


def reruns(engine: str) -> Iterator[tuple[str, float]]:
    """Yield a line for each rerun, and the relative error of the predicted peak [1]."""
    for velocity in SPEEDS:
        nominal = simulated(engine, velocity, {})
        before = largest(nominal, {})
        for name, factor in CHANGES:
            predicted = largest(nominal, {name: factor})
            then = largest(simulated(engine, velocity, in_plant(name, factor)), {})
            error = predicted.peak / then.peak - 1.0
            same = predicted.peak / predicted.speed / (then.peak / then.speed) - 1.0
            text = f"{before.peak:.1f} N, predicted {predicted.peak:.1f}, simulated {then.peak:.1f}"
            errors = f"{100 * error:+.1f} %, at equal speed {100 * same:+.1f} %"
            yield f"{engine} {velocity} rad/s, {name} x {factor:g}: {text}: {errors}", abs(error)


def bars(engine: str) -> Iterator[tuple[str, bool]]:
    """Yield a line for each value with an error bar, and whether the bar holds that of the finest simulation."""
    for velocity in ALL_SPEEDS:
        run, twin, fine = (
            judge(simulated(engine, velocity, {"time_step": STEP / part})).findings for part in (1, 2, 8)
        )
        finest = refinement(run, fine)
        for row, other in zip(refinement(run, twin), finest, strict=True):
            if row["quantity"] != PEAK:
                continue
            where = f"{engine} {velocity} rad/s, {row['subject']}: {row['value']:.1f} N"
            if row["bar"] is None or other["refined"] is None:
                yield f"{where}: no partner", row["bar"] is None  # a verdict without a bar says so
                continue
            held = abs(other["refined"] - row["value"]) <= row["bar"]
            yield f"{where} +- {row['bar']:.2g}, finest {other['refined']:.1f}: {'held' if held else 'NOT HELD'}", held


def main() -> None:
    """Run the simulations and print a line for each, and the summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("check", choices=("reruns", "bars"))
    parser.add_argument("--simulator", nargs="+", default=["mujoco", "pybullet"])
    given = parser.parse_args()
    results: list[float] = []
    for engine in given.simulator:
        for line, result in (reruns if given.check == "reruns" else bars)(engine):
            print(line, flush=True)
            results.append(float(result))
    if given.check == "reruns":
        print(f"{len(results)} reruns: largest error of the predicted peak {100 * max(results):.1f} %")
    else:
        print(f"{round(sum(results))} of {len(results)} error bars hold the value with an eighth of the time step")


if __name__ == "__main__":
    main()
