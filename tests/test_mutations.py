"""Check that the line of each mutation in tests/mutations.py is still in the code.

``python3 tests/mutations.py`` checks that a test fails with each mutation.
"""

import mutations
import pytest


@pytest.mark.parametrize("name", mutations.MUTATIONS)
def test_what_a_mutation_breaks_is_in_the_code_once(name: str) -> None:
    assert mutations.file_of(mutations.MUTATIONS[name]).suffix == ".py"
