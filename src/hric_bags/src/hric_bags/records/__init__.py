"""What a bag has of a person, of contacts and of objects, as arrays."""
