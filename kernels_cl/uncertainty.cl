// SPDX-License-Identifier: Apache-2.0
// Adaptive FLR: how far its result may be from the truth (jflnr/regression/uncertainty.py).
//
// Define beside those of the headers: FIRST, if the coarser grid is the coarsest, of which only the
// variance of its models is known.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "models.h"

// Two planes (h, pitch / GROUP, 2, GROUP) from those of the coarser grid, `before`: the variance of what
// the models keep, and the square of what the merge left out. moments: K + 1 planes. share: of the coarser grid.
// Global size (pitch / WIDTH, h).
kernel void error_step(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, global const uchar *tiles,
    global const float *moments, global const float *fine, global const float *coarse, global const float *share,
    global const float *before, global float *after)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    moments += AT(x, y, pitch, K + 1);
    fine += AT(x, y, pitch, MODELS);
    after += AT(x, y, pitch, 2);
    const coarse_t at = coarse_at(coarse, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    const coarse_t share_at = coarse_at(share, 1, coarse_h, coarse_w, coarse_pitch, x, y);
    const real n = READ(moments), per_pixel = n > 1e-12f ? 1 / n : (real)0;
    const int done = refined(tiles, h, pitch, x, y, 0, 0);
    real change = 0, more = 0;
    for (int q = 0; done && q <= Q; ++q) {
        const real guide = q == 0 ? (real)1 : READ(moments + XX(q, 0) * GROUP) * per_pixel;
        change += guide * (READ(fine + LIGHT_PLANE(q) * GROUP) - doubled(&at, LIGHT_PLANE(q)));
    }
    const real kept = doubled(&share_at, 0), dropped = (1 - kept) * change;
    if (done) more = READ(fine + VARIANCE * GROUP) - doubled(&at, VARIANCE);
#ifdef FIRST
    const real variance = doubled(&at, VARIANCE), left_out = 0;
#else
    const coarse_t error_at = coarse_at(before, 2, coarse_h, coarse_w, coarse_pitch, x, y);
    const real variance = doubled(&error_at, 0), left_out = doubled(&error_at, 1);
#endif
    WRITE(variance + kept * MAX(more, 0), after);
    WRITE(left_out + dropped * dropped, after + GROUP);
}

// The standard error of the brightness, (h, pitch), from the planes of the finest grid. own: from
// energy.cl, scaled as in apply.cl. variance_part, left_out_part, detail: VARIANCE, LEFT_OUT and DETAIL of
// uncertainty.py. Global size (pitch / WIDTH, h).
#define FACTOR(i) MAX(1 + rate[0] * restored[(long)(y / 2) * restored_pitch + (x + (i)) / 2], 0)
kernel void standard_error(
    int h, int pitch, int restored_pitch, float variance_part, float left_out_part, float detail,
    global const float *mean, global const float *rate, global const float *restored,
    global const float *own, global const float *parts, global float *error)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    parts += AT(x, y, pitch, 2);
    own += AT(x, y, pitch, C);
    real light = 0;
    for (int c = 0; c < C; ++c) light += BRIGHTNESS(c) * READ(own + c * GROUP);
    light *= LANES(real, FACTOR);
    const real square = variance_part * READ(parts) + left_out_part * READ(parts + GROUP);
    WRITE(
        sqrt(square + detail * light * light + 1e-6f * mean[0] * mean[0]),
        error + (long)y * pitch + x);
}
