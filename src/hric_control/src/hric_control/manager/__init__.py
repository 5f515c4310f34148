"""Loading, switching, updating and listing controllers; services and tools around it."""
