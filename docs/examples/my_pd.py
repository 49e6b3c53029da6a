"""A PD law of one's own, in N m, rad and s: run it with `law.name: ./my_pd.py:MyPd`."""

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
        rate = np.zeros(3)
        if self.before is not None:  # where a reading was lost, step() was not called
            tick, error_then = self.before
            rate = (error - error_then) / ((sample.tick - tick) * sample.period_s)
        self.before = sample.tick, error
        return self.kp * error + self.kd * rate
