// Pass 2 of adaptive FLR: moments of weighted pixels (Eq. 9) on the finest blocks.
//
//   weight = 1 / ((pilot / mean)^exponent + offset),   pilot = the first fit at this pixel
//   plane K: weight^2 (brightness - pilot)^2, the noise that the pilot leaves
//
// The other planes, and which pixels are left out, as in moments.cl. The models of the pilot belong
// to the centres of squares of 4 x 4 of the blocks here.
//
// Defines: those of the headers.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#define FRACTIONS
#include "products.h"
#include "grids.h"

// WIDTH divides BLOCK or is twice that; then one work-item covers two blocks side by side.
#define SIDE_BY_SIDE (WIDTH > BLOCK ? 2 : 1)
#define STEP (4 * BLOCK)

// The pilot's models along the block centres above, and how they change down to those below, at the
// pixels x to x + WIDTH - 1 of a cell between four centres.
INLINE void interpolate_pilot(
    global const float *pilot, int h, int w, int pitch, int cell_x, int cell_y, int x, real *above,
    real *down)
{
    const real right = (LANES(real, LANE_NUMBER) + (x - cell_x * STEP + 0.5f)) / STEP - 0.5f;
    const int x_0 = MAX(cell_x, 0), x_1 = MIN(cell_x + 1, w - 1);
    const int y_0 = MAX(cell_y, 0), y_1 = MIN(cell_y + 1, h - 1);
#pragma unroll
    for (int i = 0; i <= Q; ++i) {
        global const float *row_0 = pilot + ((long)i * h + y_0) * pitch;
        global const float *row_1 = pilot + ((long)i * h + y_1) * pitch;
        above[i] = row_0[x_0] + right * (row_0[x_1] - row_0[x_0]);
        down[i] = row_1[x_0] + right * (row_1[x_1] - row_1[x_0]) - above[i];
    }
}

// Global size (STRIDE(pitch) / SIDE_BY_SIDE, h). pilot: (Q + 1, pilot_h, pilot_pitch). mean: the
// frame's brightness. moments: (K + 1, h, STRIDE(pitch)).
kernel void weighted_moments(
    int width, int height, int h, int pitch, int pilot_h, int pilot_w, int pilot_pitch, float exponent,
    float offset, global const target_t *target, GUIDE_PARAMETERS, global const weight_t *weight,
    constant float *shift, global const float *pilot, global const float *mean,
    global float *moments)
{
    const int column = (int)get_global_id(0) * SIDE_BY_SIDE;
    const int bx = column - MARGIN, by = get_global_id(1);
    if (column >= STRIDE(pitch) || by >= h) return;

    real sums[K + 1];
#pragma unroll
    for (int k = 0; k <= K; ++k) sums[k] = 0;

    const float per_mean = 1 / mean[0];
    const int cell_x = (bx + 2) / 4 - 1, cell_y = (by + 2) / 4 - 1;
    const int top = by * BLOCK, bottom = MIN(top + BLOCK, height);
    const int left = bx * BLOCK, end = bx < 0 ? left : left + SIDE_BY_SIDE * BLOCK;
    const int right = MIN(end, width);
    for (int x0 = left; x0 < right; x0 += WIDTH) {
        real above[Q + 1], down[Q + 1];
        interpolate_pilot(pilot, pilot_h, pilot_w, pilot_pitch, cell_x, cell_y, x0, above, down);
        const int last = MIN(right - x0, WIDTH) - 1;
        for (int row = top; row < bottom; ++row) {
            const long pixel = (long)row * width + x0;
            real x[Q + 1], y[C];
            if (last == WIDTH - 1)
                read_pixels(target, GUIDE_IMAGES, pixel, WIDTH - 1, x, y);
            else
                read_pixels(target, GUIDE_IMAGES, pixel, last, x, y);
            real one = usable(weight, pixel, last, x, y);
            const float below = (row - cell_y * STEP + 0.5f) / STEP - 0.5f;
            real expected = above[0] + below * down[0], light = 0;
#pragma unroll
            for (int q = 0; q < Q; ++q) {
                x[q] = one > 0 ? from_shift(x[q], shift[q]) : (real)0;
                expected += x[q] * (above[q + 1] + below * down[q + 1]);
            }
#pragma unroll
            for (int c = 0; c < C; ++c) {
                y[c] = one > 0 ? y[c] : (real)0;
                light += BRIGHTNESS(c) * y[c];
            }
            real variance = MAX(expected * per_mean, 1e-6f);
            if (exponent != 1) variance = pow(variance, (real)exponent);
            one /= variance + offset;
            const real residual = one * (light - expected);
            sums[K] += residual * residual;
            add_products(sums, one, x, y);
        }
    }
    global float *block = moments + (long)by * STRIDE(pitch) + column;
#pragma unroll
    for (int k = 0; k <= K; ++k, block += (long)h * STRIDE(pitch)) {
#if WIDTH > BLOCK
        block[0] = half_sum(sums[k].lo) * (1.0f / (BLOCK * BLOCK));
        block[1] = half_sum(sums[k].hi) * (1.0f / (BLOCK * BLOCK));
#else
        block[0] = lane_sum(sums[k]) * (1.0f / (BLOCK * BLOCK));
#endif
    }
}
