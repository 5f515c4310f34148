"""Records of persons, contacts and objects in a bag, as arrays."""
