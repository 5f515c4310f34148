"""Emulated Motive (OptiTrack) that measures a moving hand, the markers of a recorded trial, or a simulated human.

Its settings and scene come from a section of an experiment file.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from hric_core.errors import HricError, ParameterError
from hric_core.geometry import UP_AXES, Pose, Vector, compose
from hric_core.geometry.poses import PoseSettings, inverse
from hric_core.parameters import Settings, choice, listing, mapping, names, number, numbers, text, variant, whole
from hric_core.trial.c3d import TrialSettings
from hric_human.hand import Hand, Motion, Program, program_of
from hric_human.hand.programs import with_programs
from hric_perception.human.simulated_body import SimulatedBody
from hric_perception.simulated import PROGRAM, person_of
from mocap_natnet.client.settings import bitstream
from mocap_natnet.codec import COMMAND_PORT, DATA_PORT, Version
from mocap_natnet.server import OCCLUSION, TRANSPORTS, TRIANGLE, CameraFaults, Motive, SceneBody, ServedScene
from mocap_natnet.server import MotiveSettings as MotiveSettings
from mocap_natnet.server.c3d_source import RecordedBody, labels_of


class Recorded(Program):
    """Program that moves the hand as in a recorded trial, without smoothing.

    Args:
        bodies: rigid bodies of the trial by name; the first is the hand.
        T_base_mocap: pose of the mocap frame, z up, in the robot's base.
    """

    def __init__(self, bodies: dict[str, RecordedBody], T_base_mocap: Pose) -> None:
        self._hand, self.bodies, self._T = next(iter(bodies.values())), bodies, T_base_mocap

    def pose(self, time: float) -> Pose:
        """Return the hand's recorded pose in the robot's base at a time of the trial [s]; gaps are interpolated."""
        return compose(self._T, self._hand.pose(time))

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of the program [s]: 0, and the duration of the recording."""
        return 0.0, self._hand.duration

    def seen(self, hand: Hand) -> list[SceneBody]:
        """Return all recorded bodies as emulated cameras see them; `hand` converts stream time to time of the trial."""
        return [_body(name, number, body, hand.since) for number, (name, body) in enumerate(self.bodies.items(), 1)]


def _body(name: str, number: int, body: RecordedBody, since: Callable[[float], float]) -> SceneBody:
    return SceneBody(name, lambda time: body(since(time)), number, body.markers, lambda time: body.seen(since(time)))


@dataclass(frozen=True)
class RecordedHuman(TrialSettings):
    """Settings of an emulated human that replays the markers of a recorded trial (c3d file)."""

    name: str = text("hand", figures=True)
    begin: float = number(0.0, minimum=0.0, maximum=3600.0, unit="s")
    still: Mapping[str, Vector] = mapping(numbers(3, unit="m"), {})
    labels: tuple[str, ...] | None = names(None, None, text="labels of the hand's markers")
    bodies: Mapping[str, tuple[str, ...]] = mapping(names(), {}, text="further rigid bodies: name -> labels of markers")

    def check(self, where: str) -> None:
        """Raise ParameterError if a further body has the hand's name."""
        if self.name in self.bodies:
            raise ParameterError(f"{where}bodies has {self.name!r}, which is the name of the hand; valid: other names")

    def recorded(self, T_base_mocap: Pose) -> Recorded:
        """Return the program that replays the trial; T_base_mocap: pose of the mocap frame. Raises ParameterError."""
        trial = self.trial()
        labelled = {self.name: self.labels, **self.bodies}
        try:
            bodies = {body: RecordedBody(trial, labels or labels_of(trial, body)) for body, labels in labelled.items()}
        except HricError as error:
            raise ParameterError(f"{self.prefix.rstrip('./')}: {error}") from error
        return Recorded(bodies, T_base_mocap)


@dataclass(frozen=True)
class StreamSettings(Settings):
    """Settings and faults of the emulated Motive's stream."""

    rate: float = number(240.0, minimum=1.0, maximum=1000.0, unit="Hz")
    version: Version = bitstream((4, 1), "newest bitstream (protocol version) of the emulated Motive", "bitstream")
    transport: str = choice(*TRANSPORTS, default="multicast")
    up_axis: str = choice(*UP_AXES)
    command_port: int = whole(COMMAND_PORT, minimum=1, maximum=65535)
    data_port: int = whole(DATA_PORT, minimum=1, maximum=65535)
    latency: float = number(0.0055, minimum=0.0, maximum=1.0, unit="s")
    jitter: float = number(0.0, minimum=0.0, maximum=1.0, unit="s")
    loss: float = number(0.0, minimum=0.0, maximum=1.0)
    drift: float = number(0.0, minimum=-1e5, maximum=1e5, unit="1e-6")
    noise: float = number(0.0, minimum=0.0, maximum=1.0, unit="m")
    rotation_noise: float = number(0.0, minimum=0.0, maximum=1.0, unit="rad")
    marker_noise: float = number(0.0, minimum=0.0, maximum=1.0, unit="m")
    occlusions: tuple[tuple[float, float, str], ...] = listing(OCCLUSION, default=())
    occlusion_rate: float = number(0.0, minimum=0.0, maximum=100.0, unit="1/s")
    occlusion_length: float = number(0.3, minimum=0.0, maximum=60.0, unit="s")

    def motive(self, seed: int) -> MotiveSettings:
        """Return the settings of the emulated Motive; seed: seed of its random jitter and packet loss."""
        shared = ("rate", "version", "transport", "command_port", "data_port", "latency", "jitter", "loss", "drift")
        return MotiveSettings(**{name: getattr(self, name) for name in shared}, seed=seed)

    def faults(self, seed: int) -> CameraFaults:
        """Return the faults of measured poses and markers: noise and occlusions; seed: seed of their randomness."""
        shared = ("noise", "rotation_noise", "marker_noise", "occlusions", "occlusion_rate", "occlusion_length")
        return CameraFaults(**{name: getattr(self, name) for name in shared}, seed=seed)


@dataclass(frozen=True)
class Marked(Settings):
    """Settings of a simulated human's hand as a rigid body with markers, and of static rigid bodies next to it."""

    name: str = text("hand", figures=True)
    still: Mapping[str, Vector] = mapping(numbers(3, unit="m"), {})
    markers: tuple[Vector, ...] = listing(numbers(3), default=(), unit="m")

    def check(self, where: str) -> None:
        """Raise ParameterError if the hand has markers, but fewer than three."""
        super().check(where)
        if self.markers and len(self.markers) < 3:
            raise ParameterError(
                f"{where}markers has {len(self.markers)} rows; valid: at least three, which a rigid body needs"
            )


@dataclass(frozen=True)
class CapturedHand(Marked, Motion):
    """Settings of a hand with markers that is moved by a program."""


PROGRAMS: dict[str, type[Settings]] = {**with_programs(CapturedHand), "c3d": RecordedHuman, PROGRAM: Marked}
HUMAN: Any = variant("program", PROGRAMS, "sinusoid", {})
"""Declaration of the mapping `human`: what moves the emulated human's hand, chosen by its key `program`."""


@dataclass(frozen=True)
class CapturedHuman:
    """Emulated human, and the emulated motion capture that measures them.

    Attributes:
        hand: moving hand.
        motive: emulated Motive that measures the hand and the static bodies.
        name: name of the hand's rigid body.
        body: body of the simulated human to whom the hand belongs; None: the hand is moved by a program.
    """

    hand: Hand
    motive: Motive
    name: str
    body: SimulatedBody | None = None


def see(
    human: Any,
    stream: Any,
    base_from_mocap: Any,
    seed: int,
    where: str = "",
    person: Any = None,
    world_from_base: Any = None,
) -> CapturedHuman:
    """Create an emulated human and the emulated Motive that measures them.

    Args:
        human: mapping with the program and its keys, `begin`, `name`, `markers`, `still`.
        stream: mapping with settings and faults of the Motive's stream.
        base_from_mocap: mapping `xyz` [m], `xyzw`: pose of the mocap frame, z up, in the robot's base, in which a
            program moves the hand; None: identity.
        seed: seed of all randomness.
        where: prefix of the mappings' names in error messages, e.g. "mocap.".
        person: section `human` of the experiment, the simulated human that the program `body` needs.
        world_from_base: mapping `xyz` [m], `xyzw`: pose of the robot's base in the world; None: identity.

    Raises:
        HricError: a value is not valid; the message names its key.
    """
    settings: Marked | RecordedHuman = HUMAN.checked(human, f"{where}human")
    streaming = StreamSettings.of(stream, f"{where}stream")
    T_base_mocap = PoseSettings.of(base_from_mocap, f"{where}base_from_mocap").pose
    T_mocap_base, simulated = inverse(T_base_mocap), None
    if isinstance(settings, RecordedHuman):
        recorded = settings.recorded(T_base_mocap)
        hand = Hand(recorded, settings.begin)
        bodies = recorded.seen(hand)
    elif isinstance(settings, CapturedHand):
        hand = Hand(program_of(settings, seed), settings.begin)
    else:
        T_base_world = inverse(PoseSettings.of(world_from_base, f"{where}world_from_base").pose)
        hand = Hand(simulated := SimulatedBody(person_of(person, where), T_base_world))
        hand.start(0.0)
    if isinstance(settings, Marked):
        bodies = [SceneBody(settings.name, _in_mocap(T_mocap_base, hand), 1, settings.markers or TRIANGLE)]
    bodies += _still(settings.still, T_mocap_base, len(bodies) + 1)
    skeletons = () if simulated is None else (simulated.skeleton(len(bodies) + 1, T_mocap_base),)
    scene = ServedScene(tuple(bodies), (), streaming.faults(seed), streaming.up_axis, skeletons=skeletons)
    _check_occlusions(streaming, scene)
    return CapturedHuman(hand, Motive(streaming.motive(seed), scene), settings.name, simulated)


def _check_occlusions(stream: StreamSettings, scene: ServedScene) -> None:
    """Raise ParameterError if an occlusion names a body that does not exist."""
    known = [body.name for body in scene.bodies] + [skeleton.name for skeleton in scene.skeletons]
    for _, _, body in stream.occlusions:
        if body and body not in known:
            raise ParameterError(f"{stream.prefix}occlusions names the body {body!r}; valid: {', '.join(known)}")


def _in_mocap(T_mocap_base: Pose, source: Callable[[float], Pose]) -> Callable[[float], Pose]:
    return lambda time: compose(T_mocap_base, source(time))


def _still(positions: Mapping[str, Vector], T_mocap_base: Pose, first: int) -> list[SceneBody]:
    """Return static rigid bodies at positions in the robot's base [m], by name; first: streaming id of the first."""
    bodies = []
    for index, (name, position) in enumerate(positions.items(), first):
        pose = compose(T_mocap_base, Pose(position))
        bodies.append(SceneBody(name, lambda time, pose=pose: pose, index))  # type: ignore[misc]
    return bodies
