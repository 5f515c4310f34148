"""Foundation of all packages: errors, parameters, geometry, robot descriptions, time, trial files and nodes."""
