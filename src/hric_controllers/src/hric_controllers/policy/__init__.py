"""Controller whose setpoints come from a trained policy, and the file format of policies."""
