/* Gyroscopic torque, fixed form; firmware_sim/controllers/gyroscopic.py has the same functions. */
#include "gyroscopic.h"

#include "fixed.h"
#include "kinematics.h"

/* Body rate, turn36, of the Euler rates v, turn36. */
static void body_rate(const int32_t angles[3], const int32_t v[3], int32_t rate[3]) {
    const int32_t sf = sin_q(angles[0]), cf = cos_q(angles[0]), st = sin_q(angles[1]), ct = cos_q(angles[1]);
    int64_t v3_ct = mul_q(v[2], ct, 30);
    rate[0] = sat32(v[0] - mul_q(v[2], st, 30));
    rate[1] = sat32(mul_q(v[1], cf, 30) + mul_q(v3_ct, sf, 30));
    rate[2] = sat32(mul_q(v3_ct, cf, 30) - mul_q(v[1], sf, 30));
}

/* Rate of the orbital frame in body axes, turn36; w0 turn36. */
static void orbit_rate(const int32_t angles[3], int32_t w0, int32_t rate[3]) {
    const int32_t sf = sin_q(angles[0]), cf = cos_q(angles[0]), st = sin_q(angles[1]);
    const int32_t ct = cos_q(angles[1]), sp = sin_q(angles[2]), cp = cos_q(angles[2]);
    int64_t st_sp = mul_q(st, sp, 30);
    int64_t y = mul_q(sf, st_sp, 30) + mul_q(cf, cp, 30), z = mul_q(cf, st_sp, 30) - mul_q(sf, cp, 30);
    rate[0] = (int32_t)-mul_q(w0, mul_q(ct, sp, 30), 30); /* each fits: w0 is at most 0.007 rad */
    rate[1] = (int32_t)-mul_q(w0, y, 30);
    rate[2] = (int32_t)-mul_q(w0, z, 30);
}

/* Component i of a x b, 2^-30 of the product, limited. */
static int32_t cross(const int32_t a[3], const int32_t b[3], int i) {
    return sat32(mul_q(a[(i + 1) % 3], b[(i + 2) % 3], 30) - mul_q(a[(i + 2) % 3], b[(i + 1) % 3], 30));
}

void gyro(const gyro_par *par, const int32_t angles[3], const int32_t rates[3], const int32_t momentum[3],
          int32_t torque[3]) {
    int32_t om[3], wo[3], l[3], r[3], o[3];
    body_rate(angles, rates, om);
    orbit_rate(angles, par->orbit, wo);
    for (int i = 0; i < 3; i++) {
        int32_t w = add_sat(om[i], wo[i]);
        l[i] = add_sat(mul_q(sat32(mul_q(w, par->scale[i], par->shift[i])), par->ts, 30), momentum[i]);
        r[i] = rad(w);
        o[i] = rad(wo[i]);
    }
    for (int i = 0; i < 3; i++) {
        int64_t carried = mul_q(cross(r, l, i), par->ts_inv, 28);
        torque[i] = sat32(carried - mul_q(cross(om, o, i), par->scale[i], par->shift[i]));
    }
}
