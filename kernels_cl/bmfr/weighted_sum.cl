// SPDX-License-Identifier: Apache-2.0
// BMFR, phase II: the fitted light, T alpha with the features as they are (Eq. 6), not below 0.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "bmfr/blocks.h"

#define SURFACE(i) surface[pixel + CLAMP(i, first, last)]

// Global size (w BLOCK / WIDTH, H). A vector lies in one block, so its lanes may be outside the frame.
// fitted: (H, W, C), 0 where there is no surface. The rest as in fit.cl.
kernel void weighted_sum(
    int width, int height, int w, int offset_x, int offset_y, global const float *surface,
    GUIDE_PARAMETERS, global const float *reached, global const float *alpha,
    global float *fitted)
{
    const int place = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    const int x0 = place - offset_x;
    if (y >= height || x0 >= width || x0 + WIDTH <= 0) return;
    const int first = MAX(-x0, 0), last = MIN(width - x0, WIDTH) - 1;
    const long pixel = (long)y * width + x0;
    const long block = (long)((y + offset_y) / BLOCK) * w + place / BLOCK;
    reached += block * ONE_BLOCK;
    alpha += block * M * C;

    real x[Q], sums[C];
    mask there = LANES(real, SURFACE) > 0;
#pragma unroll
    for (int q = 0; q < Q; ++q) {
        x[q] = first == 0 && last == WIDTH - 1
                   ? read_guide(GUIDE_IMAGES, q, pixel, 0, WIDTH - 1)
                   : read_guide(GUIDE_IMAGES, q, pixel, first, last);
        there = there & (0 * x[q] == 0);
    }
#pragma unroll
    for (int c = 0; c < C; ++c) sums[c] = alpha[c];
#pragma unroll
    for (int m = 1; m < M; ++m) {
        const real t = feature(x, m, reached);
#pragma unroll
        for (int c = 0; c < C; ++c) sums[c] += t * alpha[m * C + c];
    }
#pragma unroll
    for (int c = 0; c < C; ++c) {
        sums[c] = sums[c] < 0 ? (real)0 : sums[c] / LESS;  // NaN stays
        sums[c] = there ? sums[c] : (real)0;
    }
    if (first == 0 && last == WIDTH - 1)
        write_pixels(fitted + pixel * C, sums, 0, WIDTH - 1);
    else
        write_pixels(fitted + pixel * C, sums, first, last);
}
