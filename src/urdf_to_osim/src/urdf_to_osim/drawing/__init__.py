"""Pictures of OpenSim models."""
