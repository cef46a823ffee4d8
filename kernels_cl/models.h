// SPDX-License-Identifier: Apache-2.0
// The planes of models, as in grids.h: (Q + 1) x C coefficients, the Q + 1 of the brightness, and the
// variance of what they predict. Comes after sizes.h and grids.h.

#define LIGHT_PLANE(q) ((Q + 1) * C + (q))
#define VARIANCE LIGHT_PLANE(Q + 1)
#define MODELS (VARIANCE + 1)

// merged + part (fine - coarse) of the first `count` planes, with what is coarse interpolated to the
// finer grid.
INLINE void merge_models(
    int count, int x, int y, int pitch, int coarse_h, int coarse_w, int coarse_pitch,
    global const float *fine, global const float *coarse, global const float *coarse_merged, real part,
    global float *merged)
{
    const coarse_t at = coarse_at(coarse, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    const coarse_t before = coarse_at(coarse_merged, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    fine += AT(x, y, pitch, MODELS);
    merged += AT(x, y, pitch, MODELS);
    for (int k = 0; k < count; ++k) {
        const real step = READ(fine + k * GROUP) - doubled(&at, k);
        WRITE(doubled(&before, k) + part * step, merged + k * GROUP);
    }
}
