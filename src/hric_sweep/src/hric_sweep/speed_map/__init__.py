"""Up to which speed an arm may meet a person within the limits, over its workspace: a virtual measuring device."""
