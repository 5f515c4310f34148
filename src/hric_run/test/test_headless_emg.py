"""EMG of an experiment without a master: the envelope of a simulated human's activation, the same for each seed, in the
bag; and what of the sensors still needs wires."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bag_digest
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from sweeping_muscles import GREATEST, LEAST, PERIOD, PHASES, correlations, message

from hric_core.errors import HricError
from hric_msgs.msg import MuscleActivation, SampleChunk
from hric_perception.chunk import read_chunk
from hric_perception.emg.envelope import EnvelopeSettings, lag
from hric_report import headless as runner
from hric_run.definition import experiment
from hric_run.definition.experiment import Experiment
from hric_run.simulation import Simulation

DURATION, SWEEP = 20.0, 10.0
"""Duration of the run, and of a rise and fall of the activation [s of robot time]."""
SETTLED = 0.5
"""Time after which the filters have settled [s]."""


def defined(emg: dict[str, Any], **more: Any) -> Experiment:
    return experiment.parse("sweep", experiment.read("pd_step") | {"emg": emg, "setpoints": []} | more)


def recorded(simulation: Simulation, topic: str) -> list[Any]:
    seen: list[Any] = []
    simulation.node.subscribe(f"hric/perception/emg/{topic}", SampleChunk, seen.append)
    return seen


def publish_activation(simulation: Simulation, made: Callable[[float], Any]) -> None:
    """Publish activations as a human in the plant does: 200 messages per second, two at a time."""
    topic = simulation.node.advertise("hric/human/activation", MuscleActivation)
    state = {"next": 0}

    def on_state(_: Any) -> None:
        while simulation.time >= state["next"] * PERIOD:
            topic.publish(made(state["next"] * PERIOD))
            state["next"] += 1

    simulation.node.subscribe("joint_states", JointState, on_state)


def envelope(made: Callable[[float], Any], duration: float) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """(channels, times [s], envelope of the activation divided by its mean at full activation) of a run."""
    with Simulation(defined({"emulated": {"activation": {"program": "topic"}}}, duration=duration)) as simulation:
        smooth = recorded(simulation, "envelope")
        publish_activation(simulation, made)
        simulation.run()
    chunks = [read_chunk(chunk) for chunk in smooth]
    times = np.concatenate([chunk.times for chunk in chunks])
    return chunks[0].layout.channels, times, np.concatenate([chunk.data for chunk in chunks])


def test_the_envelope_follows_an_activation_that_sweeps_after_the_stated_lag(
    figure: Callable[[str, float, str], None],
) -> None:
    channels, times, smooth = envelope(lambda time: message(time, SWEEP), DURATION)
    assert channels == tuple(PHASES) and times[-1] > DURATION - 0.2
    kept, late = times > SETTLED, lag(EnvelopeSettings(), 2000.0)
    found = correlations(channels, times[kept], smooth[kept], SWEEP, late)
    figure("lag of the EMG envelope", 1e3 * late, "ms")
    figure(
        f"EMG envelope against activation from {LEAST} to {GREATEST}, least correlation of 8 channels", min(found), "1"
    )
    assert min(found) >= 0.95
    # The sweep of another channel, an eighth of a turn away, would not do.
    assert max(correlations(channels[1:] + channels[:1], times[kept], smooth[kept], SWEEP, late)) < 0.95


def test_the_envelope_of_a_steady_hold_is_printed(figure: Callable[[str, float, str], None]) -> None:
    held = message(0.0, SWEEP)
    held.activation = [0.3] * len(held.name)

    def hold(time: float) -> Any:
        told = message(time, SWEEP)
        told.activation = held.activation
        return told

    _, times, smooth = envelope(hold, 10.0)
    kept = smooth[times > SETTLED]
    figure("EMG envelope of a steady hold, standard deviation to mean", float((kept.std(0) / kept.mean(0)).mean()), "1")
    assert (kept > 0.0).all()


def test_a_run_has_its_emg_in_the_bag_the_same_for_each_seed(tmp_path: Path) -> None:
    def digest(bag: Path) -> dict[str, Any]:
        return {topic: bag_digest.describe(values) for topic, values in bag_digest.read(bag).items()}

    definition = defined({"emulated": {"faults": {"time_code": True, "noise": 1e-5}}}, duration=1.0)
    runs = [runner.run(definition, seed=seed, root=tmp_path, progress=False, figures=False) for seed in (3, 3, 4)]
    first, again, other = (digest(next(run.folder.path.glob("*.bag"))) for run in runs)
    assert first == again
    for name in ("raw", "envelope"):
        topic = f"/hric/perception/emg/{name}"
        assert first[topic] != other[topic], "noise has a seed"
    source = runs[0].metrics["sources"]["/hric/perception/emg/raw"]
    assert source["recorded"] == 1900 and source["driver_lost"] == 0 and source["stamps"]["largest"] < 1e-8


def test_in_an_experiment_the_electrodes_are_on_the_arm_that_follows() -> None:
    from hric_run.definition import parameters

    def side(human: dict[str, Any] | None, **given: Any) -> Any:
        emg = {"emulated": {"activation": {"program": "topic", **given}}}
        values = parameters.sensors(defined(emg, human=human), 0)
        return values["emulated_emg"]["activation"].get("side")

    left = {"parts": "both_arms", "control": {"side": "left"}}
    assert [side(None), side({}), side(left), side(left, side="right")] == [None, "right", "left", "right"]


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"emg": {"device": "real"}}, "sweep has a real emg"),
        ({"force_plate": {"transport": "natnet"}}, "sweep has force_plate over natnet"),
        ({"force_plate": {"device": "real"}, "sync": {}}, "sweep has a real force_plate, sync"),
    ],
)
def test_what_needs_wires_is_refused_by_name_beside_emg_that_needs_none(section: dict[str, Any], words: str) -> None:
    raw = experiment.read("pd_step") | {"emg": {}} | section
    with pytest.raises(HricError, match=f"{words}, which needs a network .*; valid: scripts/bringup experiment:=sweep"):
        Simulation(experiment.parse("sweep", raw))


def test_a_plate_has_its_samples_and_its_wrench_in_process() -> None:
    load = {"program": "constant", "wrench": [1.0, 2.0, -300.0, 4.0, 5.0, 6.0]}
    raw = {key: value for key, value in experiment.read("pd_step").items() if key != "setpoints"}
    with Simulation(experiment.parse("plate", raw | {"force_plate": {"emulated": {"load": load}}})) as simulation:
        samples: list[Any] = []
        simulation.node.subscribe("hric/perception/force_plate/1/samples", SampleChunk, samples.append)
        simulation.run(0.5)
    data = np.concatenate([read_chunk(chunk).data for chunk in samples])
    assert len(data) == 450 and data == pytest.approx(np.tile(load["wrench"], (450, 1)))
