"""What the firmware costs: instructions per step, stack, code and memory, against limits and a baseline."""
