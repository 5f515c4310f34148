"""Contact surfaces of links: rigid contact or penalty contact, its law, and friction."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from hric_control.plant import Surface
from hric_control.plants.contact_law import ContactLaw, Layer, in_series
from hric_core.errors import ParameterError, UnknownNameError, check_known
from hric_core.parameters import Settings, choice, number, refuse_void, text

VISCOELASTIC = "viscoelastic"
LAWS = {
    "penalty": ("damping",),
    "hunt_crossley": ("exponent", "dissipation"),
    VISCOELASTIC: ("relaxing", "relaxation_time"),
}
"""Laws of penalty contact, each with the settings that only it has."""


@dataclass(frozen=True)
class SurfaceSettings(Settings):
    """Settings of a contact surface in world files and parameters; settings that are left out do not change."""

    contact: str | None = choice(
        "rigid",
        *LAWS,
        default=None,
        text="contact law: `rigid`, of the engine; `penalty`, spring and damper; `hunt_crossley`; `viscoelastic`, a "
        "layer that relaxes",
    )
    stiffness: float | None = number(None, above=0.0, unit="N/m", text="stiffness; with an exponent n in N/m^n")
    damping: float = number(0.0, minimum=0.0, unit="N s/m", text="with `penalty`: damping")
    exponent: float = number(1.0, minimum=1.0, maximum=3.0, text="with `hunt_crossley`: exponent of the penetration")
    dissipation: float = number(0.0, minimum=0.0, unit="s/m", text="with `hunt_crossley`: dissipation")
    relaxing: float = number(0.0, minimum=0.0, unit="N/m", text="with `viscoelastic`: stiffness of the relaxing spring")
    relaxation_time: float | None = number(None, above=0.0, unit="s", text="with `viscoelastic`: relaxation time")
    friction: float | None = number(
        None, minimum=0.0, maximum=10.0, text="friction coefficient; two bodies in contact have the product of both"
    )

    def check(self, where: str) -> None:
        """Refuse values of another contact law, and a viscoelastic layer without its relaxation."""
        if self.contact not in LAWS and self.stiffness is not None:
            raise ParameterError(f"{where}stiffness needs {where}contact: {' or '.join(LAWS)}")
        for law, names in LAWS.items():
            for name in names if self.contact != law else ():
                refuse_void(self, name, where, f"{where}contact: {law}")
        if self.contact == VISCOELASTIC and not (self.relaxing and self.relaxation_time):
            raise ParameterError(f"{where}contact: {VISCOELASTIC} needs {where}relaxing and {where}relaxation_time")

    def over(self, base: Surface, default_stiffness: float) -> Surface:
        """Return the surface `base` with these settings applied; `default_stiffness`: used if none is set [N/m]."""
        friction = base.friction if self.friction is None else self.friction
        if self.contact is None:
            return replace(base, friction=friction)
        if self.contact == "rigid":
            return Surface(None, 0.0, friction)
        names = [name for of_law in LAWS.values() for name in of_law]
        law = {name: getattr(self, name) for name in names}
        return Surface(self.stiffness or default_stiffness, friction=friction, **law)


def _split(link: str) -> str:
    model, separator, name = link.partition("::")
    if not (model and separator and name):
        raise ValueError
    return link


@dataclass(frozen=True)
class SurfaceRule(SurfaceSettings):
    """Rule that sets the contact surface of links whose names match a pattern."""

    link: str = text(
        valid="model::link, each a name or a pattern such as *",
        made=_split,
        text="links to which the rule applies, model::link",
    )


class Surfaces:
    """Contact surfaces of links, determined by rules; a later rule overrides an earlier one.

    Args:
        rules: rules of the world file and of the plant's parameters.
        default_stiffness: stiffness of penalty contact if a rule sets none [N/m].
    """

    def __init__(self, rules: Sequence[SurfaceRule], default_stiffness: float) -> None:
        self._rules, self._default_stiffness = tuple(rules), default_stiffness

    def of_model(
        self, model: str, links: Iterable[str], base: Surface, by_link: Mapping[str, Surface] = {}
    ) -> dict[str, Surface]:
        """Return the surface of each link of a model: by the rules, else from `by_link`, else `base`.

        Raises:
            UnknownNameError: a rule names the model, but matches none of its links, or `by_link` has an unknown link.
        """
        surfaces = dict.fromkeys(links, base)
        check_known("link", by_link, surfaces, f"surfaces of model {model}")
        surfaces.update(by_link)
        for rule in self._rules:
            model_pattern, _, link_pattern = rule.link.partition("::")
            if not fnmatchcase(model, model_pattern):
                continue
            meant = [link for link in surfaces if fnmatchcase(link, link_pattern)]
            if not meant and model_pattern == model:
                raise UnknownNameError(
                    "link", link_pattern, surfaces, f"model {model}, for the rule {rule.link} of surfaces"
                )
            surfaces.update({link: rule.over(surfaces[link], self._default_stiffness) for link in meant})
        return surfaces


def combine(first: Surface, second: Surface) -> tuple[ContactLaw, float] | None:
    """Return the law of the normal force between two surfaces and their friction coefficient [1]; None: both are rigid.

    Raises:
        ParameterError: the laws of the surfaces have different exponents.
    """
    laws = [_law(surface) for surface in (first, second) if surface.stiffness is not None]
    if not laws:
        return None
    exponents = {law.exponent for law in laws}
    if len(exponents) > 1 or (exponents != {1.0} and any(law.layers for law in laws)):
        raise ParameterError(
            f"two surfaces in contact have the exponents {' and '.join(f'{law.exponent:g}' for law in laws)}; valid: "
            "the same exponent for both, 1 with a viscoelastic surface, or contact: rigid for one of them"
        )
    return in_series(laws), first.friction * second.friction


def _law(surface: Surface) -> ContactLaw:
    assert surface.stiffness is not None
    if surface.relaxation_time is not None:
        layer = Layer(surface.stiffness, surface.relaxing, surface.relaxation_time)
        return ContactLaw(surface.stiffness, layers=(layer,))
    return ContactLaw(surface.stiffness, surface.damping, surface.exponent, surface.dissipation)
