"""The truth: formations and their stress, manoeuvres, physics, sensors, and the recording of a run."""
