"""The mutations fit the code. Whether tests notice them: python3 tests/mutations.py, docs/mutations.md."""

import mutations
import pytest


@pytest.mark.parametrize("name", mutations.MUTATIONS)
def test_what_a_mutation_breaks_is_in_the_code_once(name: str) -> None:
    assert mutations.file_of(mutations.MUTATIONS[name]).suffix == ".py"
