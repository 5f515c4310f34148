"""The section `mocap` of an experiment file: what is streamed, and how the human before the cameras moves."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hric_perception.section import Section

if TYPE_CHECKING:
    from hric_perception.human import Seen

MOCAP_KEYS = ("base_from_mocap", "body", "human", "stream")


@dataclass(frozen=True)
class MocapSpec:
    """The motion capture of an experiment.

    Attributes:
        body: whose position is /mocap/marker, and which the metrics compare with the end effector.
        stream: how the emulated Motive streams.
        human: how the emulated human moves.
        base_from_mocap: `xyz` [m] and `xyzw`: pose of the mocap frame, z up, in the robot's base; None: not known, positions stay in the mocap frame.
    """

    body: str
    stream: Mapping[str, Any] = field(default_factory=dict)
    human: Mapping[str, Any] = field(default_factory=dict)
    base_from_mocap: Mapping[str, Any] | None = None

    def build(self, seed: int) -> Seen:
        """The emulated human and the Motive that sees him.

        Raises:
            HricError: a value that cannot be; names the key.
        """
        # Who runs the human alone needs it: it takes as long to load as all else that an experiment is read with.
        from hric_perception.human import see

        return see(self.human, self.stream, self.base_from_mocap, seed, "mocap.")


def read_mocap(raw: Any) -> MocapSpec:
    """Check the section.

    Raises:
        HricError: an unknown key or a value that cannot be; names the key and what is valid.
    """
    section = Section("mocap", raw)
    section.only(*MOCAP_KEYS)
    parts = {key: copy.deepcopy(section.section(key).content) for key in ("stream", "human")}
    base = section.section("base_from_mocap").content if section.content.get("base_from_mocap") is not None else None
    seen = MocapSpec("", **parts, base_from_mocap=base).build(0)
    return MocapSpec(section.text("body", seen.name, [body.name for body in seen.motive.scene.bodies]), **parts, base_from_mocap=base)
