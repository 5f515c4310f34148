"""How far a person is from an arm, and how far he should be."""
