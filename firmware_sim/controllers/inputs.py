"""What a law is given at a tick and what it gives back: indices of the arrays `inp` and `out`.

`inp` is int64 in wire units (fixed form) or float64 in SI units (float form); si_scale() takes one to the other.
`out` is [torque x, y, z, flags]: torque on the body in the wire's LSB (fixed) or N m (float), within the law's limits;
NOT_A_NUMBER or NaN where the law has none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

FRESH = 0  # 1: this tick's reading is there and used (or, by `stale: reuse`, an old one passed for it)
GOOD_RUN = 1  # readings used in a row, this one included
APPLIED_KNOWN = 2  # 1: APPLIED is the laboratory's word for what acts from t_k on, or the watchdog's zero
EULER = slice(3, 6)  # 2^-32 turn | rad
QUATERNION = slice(6, 10)  # 2^-30 | 1, scalar first
RATE = slice(10, 13)  # 2^-rate_bits | rad/s, body axes
APPLIED = slice(13, 16)  # 2^-torque_bits | N m, acts from t_k on
MOMENTUM = slice(16, 19)  # 2^-momentum_bits | N m s, wheels at t_k
SETPOINT = slice(19, 22)  # 2^-32 turn | rad, r(k)
TICK = 22  # k
SIZE = 23
READINGS = (EULER, QUATERNION, RATE)

# First indices, for compiled code.
I_EULER, I_QUATERNION, I_RATE, I_APPLIED, I_MOMENTUM, I_SETPOINT = 3, 6, 10, 13, 16, 19

OUT_FLAGS = 3
NOT_A_NUMBER = -(2**63)  # a torque in out of the fixed form that is not a number; NaN in the float form
# Flags of out, the same bits as COMMAND's.
SATURATED, IDENTIFICATION_PAUSED, ARITHMETIC, STARTING = 1 << 0, 1 << 2, 1 << 3, 1 << 5


def si_scale(common: Mapping[str, int]) -> np.ndarray:
    """Factors (SIZE,) from wire units to SI units."""
    scale = np.ones(SIZE)
    bam_rad = 2.0 * math.pi / 2**32
    scale[EULER] = scale[SETPOINT] = bam_rad
    scale[QUATERNION] = 2.0**-30
    scale[RATE] = 2.0 ** -common["rate_bits"]
    scale[APPLIED] = 2.0 ** -common["torque_bits"]
    scale[MOMENTUM] = 2.0 ** -common["momentum_bits"]
    return scale
