"""Random frames and descriptions with all kinds of contents, seeded."""

import numpy as np

from mocap_natnet.codec import descriptions as d
from mocap_natnet.codec.types import Analog, Asset, BodyMarker, Frame, Marker, MarkerSet, RigidBody, Skeleton, Suffix

VERSIONS = [(2, 5), (2, 6), (2, 7), (2, 9), (2, 10), (3, 0), (3, 1), (4, 0), (4, 1), (4, 2), (4, 3), (4, 4), (4, 5)]


class Sample:
    """Generator of random contents; all numbers can be represented as float32."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)

    def numbers(self, count: int) -> tuple[float, ...]:
        return tuple(self._random.normal(size=count).astype(np.float32).tolist())

    def integer(self) -> int:
        return int(self._random.integers(-(2**31), 2**31))

    def flags(self) -> int:
        return int(self._random.integers(-(2**15), 2**15))

    def several(self, make):
        return tuple(make() for _ in range(int(self._random.integers(0, 4))))

    def name(self) -> str:
        return "".join(self._random.choice(list("abcÆøå _1"), size=int(self._random.integers(0, 9))).tolist())

    def body(self) -> RigidBody:
        markers = self.several(lambda: BodyMarker(self.numbers(3), self.integer(), *self.numbers(1)))
        return RigidBody(self.integer(), self.numbers(3), self.numbers(4), *self.numbers(1), self.flags(), markers)

    def marker(self) -> Marker:
        return Marker(self.integer(), self.numbers(3), *self.numbers(1), self.flags(), *self.numbers(1))

    def plain_body(self) -> RigidBody:
        return self.body()._replace(markers=())

    def analog(self) -> Analog:
        return Analog(self.integer(), self.several(lambda: self.numbers(int(self._random.integers(0, 6)))))

    def frame(self) -> Frame:
        return Frame(
            self.integer(),
            self.several(lambda: MarkerSet(self.name(), self.several(lambda: self.numbers(3)))),
            self.several(lambda: self.numbers(3)),
            self.several(self.body),
            self.several(lambda: Skeleton(self.integer(), self.several(self.body))),
            self.several(lambda: Asset(self.integer(), self.several(self.plain_body), self.several(self.marker))),
            self.several(self.marker),
            self.several(self.analog),
            self.several(self.analog),
            Suffix(
                *self.numbers(1),
                17,
                18,
                *self.numbers(1),
                *(int(n) for n in self._random.integers(0, 2**63, 3)),
                19,
                20,
                self.flags(),
            ),
        )

    def described_body(self) -> d.RigidBodyDescription:
        markers = self.several(lambda: d.DescribedMarker(self.numbers(3), self.integer(), self.name()))
        return d.RigidBodyDescription(
            self.name(), self.integer(), self.integer(), self.numbers(3), self.numbers(4), markers
        )

    def model(self) -> d.ServerModel:
        corners = tuple(self.numbers(3) for _ in range(4))
        asset_markers = self.several(
            lambda: d.AssetMarkerDescription(
                self.name(), self.integer(), self.numbers(3), *self.numbers(1), self.flags()
            )
        )
        return d.ServerModel(
            (
                d.MarkerSetDescription(self.name(), self.several(self.name)),
                self.described_body(),
                d.SkeletonDescription(self.name(), self.integer(), self.several(self.described_body)),
                d.ForcePlateDescription(
                    1,
                    self.name(),
                    *self.numbers(2),
                    self.numbers(3),
                    self.numbers(144),
                    corners,
                    2,
                    0,
                    self.several(self.name),
                ),
                d.DeviceDescription(2, self.name(), self.name(), 3, 1, self.several(self.name)),
                d.CameraDescription(self.name(), self.numbers(3), self.numbers(4)),
                d.AssetDescription(self.name(), 1, self.integer(), self.several(self.described_body), asset_markers),
            )
        )


def one_body_frame(number: int = 1) -> Frame:
    """Return a frame as Motive sends it for one body of three markers: marker sets, unlabelled list, body, markers."""
    positions = ((0.1, 1.0, 0.2), (0.2, 1.0, 0.2), (0.1, 1.1, 0.2))
    markers = tuple(Marker(1 << 16 | index, position, 0.014, 10, 0.0004) for index, position in enumerate(positions, 1))
    suffix = Suffix(0.0, 0, 0, number / 240, 10**12, 10**12 + 40000, 10**12 + 55000)
    body = RigidBody(1, (0.133, 1.033, 0.2), (0.0, 0.0, 0.0, 1.0), 0.0002)
    return Frame(
        number,
        (MarkerSet("hand", positions), MarkerSet("all", positions)),
        positions,
        (body,),
        (),
        (),
        markers,
        (),
        (),
        suffix,
    )
