/* Gyroscopic torque of a satellite with wheels, as a law compensates it. firmware_sim/controllers/gyroscopic.py has the
 * equations.
 */
#ifndef CORE_GYROSCOPIC_H
#define CORE_GYROSCOPIC_H

#include <stdint.h>

/* What the torque depends on besides attitude, rate and momentum; scale[3] is wider than 32 bits. */
typedef struct {
    const int64_t *scale; /* [3]: torque N m Q28 = acceleration turn36 scale 2^-shift */
    const int32_t *shift; /* [3] */
    int32_t ts;           /* s Q30 */
    int32_t ts_inv;       /* 1/s Q28 */
    int32_t orbit;        /* w0, turn36 */
} gyro_par;

/* Gamma, N m Q28; angles bam, Euler rates turn36, wheel momentum N m s Q28. */
void gyro(const gyro_par *par, const int32_t angles[3], const int32_t rates[3], const int32_t momentum[3],
          int32_t torque[3]);

#endif
