"""The balance of joint efforts with rotor inertia, compiled and written out."""

import numpy as np
import pytest

from pybullet_ros_control import balance
from pybullet_ros_control.balance import MOST_COMPILED, make_balance, written_out


def problem(rng, n):
    half = rng.uniform(-1, 1, (n, n))
    M, b = half @ half.T + 0.1 * np.eye(n), rng.uniform(0, 1, n)
    return M, *rng.uniform(-5, 5, (2, n)), b, rng.uniform(-5, 5, n)


def plain(M, h, t, b, v):
    return tuple(map(tuple, M.tolist())), tuple(h.tolist()), t.tolist(), b.tolist(), tuple(v.tolist()), 1e-3


@pytest.mark.parametrize("n", [1, 2, 7, 9, MOST_COMPILED + 1])
@pytest.mark.parametrize("made", [make_balance, written_out])
def test_it_solves_the_equations_of_motion_with_rotor_inertia(rng, n, made):
    M, h, t, b, v = problem(rng, n)
    effort, velocity = made(n)(*plain(M, h, t, b, v))
    x = np.linalg.solve(M + np.diag(b), t - h)
    assert effort == pytest.approx((t - b * x).tolist(), rel=1e-9, abs=1e-9)
    assert velocity == pytest.approx((v + 1e-3 * x).tolist(), rel=1e-9, abs=1e-12)


def test_compiled_and_written_out_give_the_same_bits(rng):
    for _ in range(200):
        given = plain(*problem(rng, 7))
        assert balance.compiled()(*given) == written_out(7)(*given)


def test_what_is_no_matrix_of_the_right_size_is_refused_and_not_read(rng):
    M, *rest = plain(*problem(rng, 7))
    function = balance.compiled()
    with pytest.raises(ValueError, match="too few rows"):
        function(M[:6], *rest)
    with pytest.raises(ValueError, match="too few numbers"):
        function((*M[:6], M[6][:5]), *rest)
    with pytest.raises(TypeError):
        function((*M[:6], "abcdefg"), *rest)
    with pytest.raises(TypeError):
        function(M, None, *rest[1:])


def test_without_a_compiler_the_sums_are_done_in_python(monkeypatch):
    monkeypatch.setenv("CC", "nowhere-cc")
    balance.compiled.cache_clear()
    try:
        assert balance.compiled() is None and make_balance(7) is not None
    finally:
        balance.compiled.cache_clear()
