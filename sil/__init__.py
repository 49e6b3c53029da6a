"""The laboratory: plant, sensors, actuators, the loop and everything around a test."""
