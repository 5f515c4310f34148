"""Controller manager: loading, switching, updating and listing controllers; its services and command-line tools."""
