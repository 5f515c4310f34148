"""Assessment of the energy of a contact against the energy limits of the touched body region.

The transferred energy is the largest work that both bodies have done on their contact, in the laws of
`hric_control.plants.contact_law`; in a free impact without other forces it is mu v^2/2 with any of them. A recording
without it, as of a force sensor, has the energy F^2/(2 k) of the table's spring at the peak force.
"""

from collections.abc import Sequence

from hric_assessment.contact.assess import ContactSite
from hric_assessment.contact.episodes import PENALTY, Episode
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.speed import transfer_energy
from hric_assessment.findings import ENERGY, Finding, Outcome
from hric_human.contact import RegionContact

MEASURED, BY_SPRING = "work of the bodies on the contact", "F^2/(2 k) of the table's spring at the peak force"


def energy_finding(episode: Episode, site: ContactSite, limits: Limits, *, held: bool = False) -> Finding | None:
    """Return the finding about the energy of a contact; None: contact is not permitted, or it has no force or limit.

    Args:
        episode: force over time, with its contacts and the doubts about it.
        site: place of the contact.
        limits: limits of the body regions.
        held: True if the contact counts as quasi-static from its begin; the limit is then that of the quasi-static
            force.
    """
    if site.kind != PENALTY or not episode.known or list(site.regions) != site.permitted_regions:
        return None
    measured, rows = absorbed(episode.contacts), [limits.energy(region, held=held) for region in site.regions]
    known = [row for row in rows if row is not None]
    if not known or len(known) < len(rows):
        return None
    force = episode.overall.peak
    pairs = [(transfer_energy(force, row.stiffness) if measured is None else measured, row) for row in known]
    energy, limit = max(pairs, key=lambda pair: pair[0] / pair[1].energy)
    share = energy / limit.energy
    outcome, reason = Outcome.WITHIN, f"energy {energy:.3f} of {limit.energy:.3f} J ({limit.region})"
    if share > 1.0:
        outcome = Outcome.ABOVE
    elif episode.doubts:
        outcome, reason = Outcome.NOT_ASSESSABLE, f"{'; '.join(episode.doubts)}; {reason}"
    return Finding(
        f"energy of the {site.subject}",
        outcome,
        reason,
        limits.table.name,
        share,
        {"transferred energy [J]": energy, "energy limit [J]": limit.energy},
        (episode.overall.begin, episode.overall.end),
        notes=(f"transferred energy: {BY_SPRING if measured is None else MEASURED}", f"energy limit: {limit.mark}"),
        group=ENERGY,
    ).marked_near_limit()


def absorbed(contacts: Sequence[RegionContact]) -> float | None:
    """Return the energy of the contacts of an episode [J]; None: it is not known of one of them.

    Of repeated contacts of two bodies the largest counts; those with several links of one robot are added, whether they
    are simultaneous or not; of several models the largest counts.
    """
    by_link: dict[tuple[str, str], float] = {}
    for contact in contacts:
        if contact.energy is None:
            return None
        key = contact.other, contact.link
        by_link[key] = max(by_link.get(key, 0.0), contact.energy)
    by_model: dict[str, float] = {}
    for (other, _), energy in by_link.items():
        model = other.partition("::")[0]
        by_model[model] = by_model.get(model, 0.0) + energy
    return max(by_model.values(), default=None)
