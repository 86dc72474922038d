"""Where agents are: bodies, sensors, disturbances, a target."""
