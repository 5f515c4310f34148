"""Pictures of a converted model."""
