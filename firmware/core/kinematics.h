/* Euler angles 3-2-1: body acceleration from Euler acceleration, and back; torque scales and limits. All [x, y, z].
 * firmware_sim/controllers/kinematics.py has the equations. Angles bam; rates and accelerations turn36.
 */
#ifndef CORE_KINEMATICS_H
#define CORE_KINEMATICS_H

#include <stdint.h>

/* Body acceleration of the Euler acceleration a at the Euler rates v. body may be a. */
void inverse(const int32_t angles[3], const int32_t v[3], const int32_t a[3], int32_t body[3]);

/* Euler acceleration of the body acceleration b. euler may be b. */
void forward(const int32_t angles[3], const int32_t v[3], const int32_t b[3], int32_t euler[3]);

/* turn36 to rad Q30. */
int32_t rad(int32_t x);

/* Between torque (N m Q28) and acceleration (turn36) of an inertia (kg m^2 Q26), a mantissa and a shift each:
 * acceleration = torque drive_of 2^-drive_shift, torque = acceleration torque_of 2^-demand_shift. */
void torque_scales(int32_t period_us, const int32_t inertia_q26[3], int32_t torque_of[3], int32_t drive_of[3],
                   int32_t demand_shift[3], int32_t drive_shift[3]);

/* torque_limit x, y, z in Q28 from the common words; at most 8 N m, and at most what 32 bits of the wire's LSB hold. */
void torque_limits(const int32_t *common, int32_t limits[3]);

#endif
