"""Published experiments that are simulated again and compared with the measured values."""
