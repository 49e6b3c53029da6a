/* One gain g from x = c g: both signals filtered alike, then scalar recursive least squares without forgetting.
 * firmware_sim/controllers/gain.py has the equations.
 */
#ifndef CORE_GAIN_H
#define CORE_GAIN_H

#include <stdint.h>

/* y - 2 y1 + y2: bam to turn36. */
void second_differences(const int32_t y[3], const int32_t y1[3], const int32_t y2[3], int32_t z[3]);

/* The filtered x: turn36 in, rad Q35 out (limited to 1/16 rad). */
int32_t washed(int32_t states[3], int32_t x);

/* g (Q28) and P (Q34) after one measurement; x, c rad Q35. */
void learn(int32_t *g, int32_t *P, int32_t x, int32_t c);

#endif
