// SPDX-License-Identifier: Apache-2.0
// The one pass of method auto over the light: moments on the finest blocks, and as two more planes the mean
// squares of the brightness and of the weight. Which pixels are left out, as in moments.cl.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "products.h"
#include "grids.h"
#define PLANES (K + 2)
#include "means.h"

INLINE void add_blocks(
    int width, int height, int bx, int by, global const target_t *target, GUIDE_PARAMETERS,
    global const weight_t *weight, constant float *shift, global float *block)
{
    real sums[PLANES];
#pragma unroll
    for (int k = 0; k < PLANES; ++k) sums[k] = 0;
    const int left = bx * BLOCK, right = MIN(left + ACROSS * BLOCK, width);
    const int top = by * BLOCK, bottom = MIN(top + BLOCK, height);
    for (int row = top; row < bottom; ++row) {
        for (int x0 = left; x0 < right; x0 += WIDTH) {
            const long pixel = (long)row * width + x0;
            const int last = MIN(right - x0, WIDTH) - 1;
            real x[Q + 1], y[C], light = 0;
            const real one =
                read_usable(target, GUIDE_IMAGES, weight, shift, pixel, last, x, y);
#pragma unroll
            for (int c = 0; c < C; ++c) light += BRIGHTNESS(c) * y[c];
            sums[K] += one * light * light;
            sums[K + 1] += one * one;
            add_products(sums, one, x, y);
        }
    }
    write_means(sums, block);
}

// One work-item has GROUP blocks: of a group of one that has less, PoCL takes longer to begin with it.
// Global size (pitch / GROUP, h). blocks: (h, pitch / GROUP, PLANES, GROUP).
kernel void block_moments(
    int width, int height, int h, int pitch, global const target_t *target, GUIDE_PARAMETERS,
    global const weight_t *weight, constant float *shift, global float *blocks)
{
    const int first = (int)get_global_id(0) * GROUP, by = get_global_id(1);
    if (first >= pitch || by >= h) return;
    for (int bx = first; bx < first + GROUP; bx += ACROSS)
        add_blocks(
            width, height, bx, by, target, GUIDE_IMAGES, weight, shift,
            blocks + AT(bx, by, pitch, PLANES));
}
