/* Attitude error of Euler angles y against reference angles r: their difference, or in body axes.
 * firmware_sim/controllers/attitude_error.py has the equations. Angles bam, e rad Q29, all [x, y, z].
 */
#ifndef CORE_ATTITUDE_ERROR_H
#define CORE_ATTITUDE_ERROR_H

#include <stdint.h>

enum { ERROR_EULER = 0, ERROR_QUATERNION = 1 };

/* sequence: the CONFIG word attitude_sequence. */
void attitude_error(int32_t kind, int32_t sequence, const int32_t y[3], const int32_t r[3], int32_t e[3]);

#endif
