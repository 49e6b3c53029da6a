"""Many runs of one scenario: axes, plan, workers, results. What `sil sweep` does; `sweep.py` is the place to start."""
