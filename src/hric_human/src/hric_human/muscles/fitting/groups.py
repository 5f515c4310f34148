"""Groups of muscle elements of the Delft model that are joined into one line of action each."""

from typing import NamedTuple


class Group(NamedTuple):
    """Muscle elements joined into one line of action: sum of forces, force-weighted mean of lengths and directions.

    Attributes:
        name: name of the line.
        elements: names of the elements in das4_v4.osim.
        arm: constant moment arm about pro_sup [m] if the paths in the file are unusable; the line then acts on that
            joint only. 0 if the paths are used.
    """

    name: str
    elements: tuple[str, ...]
    arm: float = 0.0


def _group(name: str, stem: str, *numbers: int | str, arm: float = 0.0) -> Group:
    # das4_v4.osim has no underscore before numbers of two digits: infra_1, but subscap10.
    return Group(name, tuple(f"{stem}_{k}" if len(str(k)) == 1 else f"{stem}{k}" for k in numbers), arm)


GROUPS = (
    _group("delt_clav_a", "delt_clav", 1),
    _group("delt_clav_b", "delt_clav", 2, 3, 4),
    _group("delt_scap_a", "delt_scap", 1, 2),
    _group("delt_scap_b", "delt_scap", 3, 4),
    _group("delt_scap_c", "delt_scap", 5, 6, 7, 8),
    _group("delt_scap_d", "delt_scap", 9, 10, 11),
    _group("coracobr", "coracobr", 1, 2, 3),
    _group("infra_a", "infra", 1, 2, 3),
    _group("infra_b", "infra", 4, 5, 6),
    _group("ter_min", "ter_min", 1, 2, 3),
    _group("ter_maj", "ter_maj", 1, 2, 3, 4),
    _group("supra_a", "supra", 1, 2),
    _group("supra_b", "supra", 3, 4),
    _group("subscap_a", "subscap", 1, 2, 3),
    _group("subscap_b", "subscap", 4, 5, 6),
    _group("subscap_c", "subscap", 7, 8, 9, 10, 11),
    _group("bic_l", "bic", "l"),
    _group("bic_b", "bic_b", 1, 2),
    _group("tric_long", "tric_long", 1, 2, 3, 4),
    _group("lat_dorsi_a", "lat_dorsi", 1, 2, 3),
    _group("lat_dorsi_b", "lat_dorsi", 4, 5, 6),
    _group("pect_maj_t_a", "pect_maj_t", 1, 2, 3, 4),
    _group("pect_maj_t_b", "pect_maj_t", 5, 6),
    _group("pect_maj_c", "pect_maj_c", 1, 2),
    _group("tric_med", "tric_med", 1, 2, 3, 4, 5),
    _group("tric_lat", "tric_lat", 1, 2, 3, 4, 5),
    _group("brachialis_a", "brachialis", 1, 2),
    _group("brachialis_b", "brachialis", 3, 4, 5, 6, 7),
    _group("brachiorad", "brachiorad", 1, 2, 3),
    _group("pron_teres_a", "pron_teres", 1),
    _group("pron_teres_b", "pron_teres", 2),
    _group("anconeus", "anconeus", 1, 2, 3, 4, 5),
    # These paths of the file jump across the bone within the range; the moment arms are project defaults, unconfirmed.
    _group("supinator", "supinator", 1, 2, 3, 4, 5, arm=-0.008),
    _group("pron_quad", "pron_quad", 1, 2, 3, arm=0.006),
)
