"""The ladder: one scenario on every board, from the float law in this process up to the firmware, rung by rung."""
