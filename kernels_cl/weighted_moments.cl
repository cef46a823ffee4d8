// SPDX-License-Identifier: Apache-2.0
// Pass 2 of adaptive FLR: moments of weighted pixels (Eq. 9) on the finest blocks.
//
//   weight = 1 / ((pilot / mean)^exponent + offset),   pilot = the first fit at this pixel
//   plane K: weight^2 (brightness - pilot)^2, the noise that the pilot leaves
//
// The other planes, and which pixels are left out, as in moments.cl. The models of the pilot belong
// to the centres of squares of 4 x 4 of the blocks here.
//
// Defines beside those of the headers: PROPORTIONAL, if the exponent is 1.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#define FRACTIONS
#include "products.h"
#include "grids.h"
#define PLANES (K + 1)
#include "means.h"

#define STEP (4 * BLOCK)
// The pilot's are models of one channel, see models.h.
#define PILOT_PLANES (2 * (Q + 1) + 1)

// The pilot's models along the block centres above, and how they change down to those below, at the
// pixels x to x + WIDTH - 1 of a cell between four centres.
INLINE void interpolate_pilot(
    global const float *pilot, int h, int w, int pitch, int cell_x, int cell_y, int x, real *above,
    real *down)
{
    const real right = (LANES(real, LANE_NUMBER) + (x - cell_x * STEP + 0.5f)) / STEP - 0.5f;
    const long left = COLUMN(MAX(cell_x, 0), PILOT_PLANES);
    const long next = COLUMN(MIN(cell_x + 1, w - 1), PILOT_PLANES);
    const int y_0 = MAX(cell_y, 0), y_1 = MIN(cell_y + 1, h - 1);
#pragma unroll
    for (int i = 0; i <= Q; ++i) {
        global const float *row_0 = pilot + AT(0, y_0, pitch, PILOT_PLANES) + i * GROUP;
        global const float *row_1 = pilot + AT(0, y_1, pitch, PILOT_PLANES) + i * GROUP;
        above[i] = row_0[left] + right * (row_0[next] - row_0[left]);
        down[i] = row_1[left] + right * (row_1[next] - row_1[left]) - above[i];
    }
}

// Adds the products of the pixels pixel to pixel + last to the sums.
INLINE void add_pixels(
    global const target_t *target, GUIDE_PARAMETERS, global const weight_t *weight,
    constant float *shift, long pixel, int last, float below, const real *above, const real *down,
    float per_mean, float exponent, float offset, real *sums)
{
    real x[Q + 1], y[C];
    real one = read_usable(target, GUIDE_IMAGES, weight, shift, pixel, last, x, y);
    real expected = above[0] + below * down[0], light = 0;
#pragma unroll
    for (int q = 0; q < Q; ++q) expected += x[q] * (above[q + 1] + below * down[q + 1]);
#pragma unroll
    for (int c = 0; c < C; ++c) light += BRIGHTNESS(c) * y[c];
    real variance = MAX(expected * per_mean, 1e-6f);
#ifndef PROPORTIONAL
    variance = pow(variance, (real)exponent);
#endif
    one /= variance + offset;
    const real residual = one * (light - expected);
    sums[K] += residual * residual;
    add_products(sums, one, x, y);
}

// Global size (pitch / ACROSS, h). pilot: models of one channel. mean: the frame's brightness. moments:
// (h, pitch / GROUP, K + 1, GROUP).
kernel void weighted_moments(
    int width, int height, int h, int pitch, int pilot_h, int pilot_w, int pilot_pitch, float exponent,
    float offset, global const target_t *target, GUIDE_PARAMETERS, global const weight_t *weight,
    constant float *shift, global const float *pilot, global const float *mean,
    global float *moments)
{
    const int bx = (int)get_global_id(0) * ACROSS, by = get_global_id(1);
    if (bx >= pitch || by >= h) return;

    real sums[K + 1];
#pragma unroll
    for (int k = 0; k <= K; ++k) sums[k] = 0;

    const float per_mean = 1 / mean[0];
    const int cell_x = (bx + 2) / 4 - 1, cell_y = (by + 2) / 4 - 1;
    const int left = bx * BLOCK, right = MIN(left + ACROSS * BLOCK, width);
    const int top = by * BLOCK, bottom = left < right ? MIN(top + BLOCK, height) : top;
    for (int x0 = left; x0 < right; x0 += WIDTH) {
        real above[Q + 1], down[Q + 1];
        interpolate_pilot(pilot, pilot_h, pilot_w, pilot_pitch, cell_x, cell_y, x0, above, down);
        const int last = MIN(right - x0, WIDTH) - 1;
        for (int row = top; row < bottom; ++row) {
            const float below = (row - cell_y * STEP + 0.5f) / STEP - 0.5f;
            add_pixels(
                target, GUIDE_IMAGES, weight, shift, (long)row * width + x0, last, below, above, down,
                per_mean, exponent, offset, sums);
        }
    }
    write_means(sums, moments + AT(bx, by, pitch, K + 1));
}
