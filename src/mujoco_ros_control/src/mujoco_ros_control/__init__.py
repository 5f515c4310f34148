"""Physics plant on MuJoCo."""
