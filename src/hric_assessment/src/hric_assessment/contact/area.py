"""Check of contact areas: most impossible values come from a wrong unit.

    check_area(2e-5, ["hand, fingers"])
    check_area(0.2)                         # 2000 cm^2: ParameterError, which suggests 2e-5

The ranges by region are in config/tables/contact_areas.yaml.
"""

import math
from collections.abc import Iterable

from hric_assessment.tables import area_table
from hric_core.errors import ParameterError

CM2 = 1e-4
"""One square centimetre [m^2]."""


def check_area(area: float, regions: Iterable[str] = (), name: str = "contact_area") -> None:
    """Refuse an impossible contact area.

    Args:
        area: contact area [m^2].
        regions: body regions that may be in contact; empty: any.
        name: name of the option or key, for the error message.

    Raises:
        ParameterError: the area is smaller than the minimum of the table, or larger than a contact with one of the
            regions can be.
    """
    table = area_table()
    known = {region: table.largest[region] for region in regions if region in table.largest}
    if known:
        region, largest = min(known.items(), key=lambda item: item[1])
        of = f"what a contact with {region} can cover"
    else:
        largest, of = max(table.largest.values()), "what a contact with a body can cover"
    smallest = table["smallest"]
    if smallest <= area <= largest:
        return
    valid = f"valid: {smallest:g} to {largest:g} m^2 ({table.mark})"
    if not math.isfinite(area) or area <= 0.0:
        raise ParameterError(f"{name} is {area:g} m^2; {valid}")
    meant = f"; did you mean {area:g} cm^2: {area * CM2:g}?" if smallest <= area * CM2 <= largest else ""
    side = "larger" if area > largest else "smaller"
    raise ParameterError(f"{name} is {area:g} m^2, which is {area / CM2:g} cm^2, {side} than {of}; {valid}{meant}")
