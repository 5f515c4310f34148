"""Published experiments: one YAML file each, and the functions that simulate them."""
