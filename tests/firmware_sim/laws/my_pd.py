"""A PD law of one's own: run it with `law.name: ./my_pd.py:MyPd`."""

import numpy as np


class MyPd:
    PARAMS = {  # name: (default, unit, smallest step)
        "kp": (0.02, "N m/rad", 1e-6),
        "kd": (0.25, "N m s/rad", 1e-6),
    }

    def init(self, params):
        self.kp, self.kd = params["kp"], params["kd"]
        self.before = None

    def step(self, sample):
        error = sample.reference_rad - sample.attitude_rad
        change = np.zeros(3) if self.before is None else error - self.before
        self.before = error
        return self.kp * error + self.kd * change / sample.period_s
