// SPDX-License-Identifier: Apache-2.0
// Kernel 1: outer products of [1, X, Y], averaged over blocks (section 3.2).
//
//   moments[k] = 1/BLOCK^2  sum over the pixels p of the block  weight(p) u_k(p) v_k(p)
//
// u_k v_k being the k-th product of [1, X - shift, Y] (see sizes.h). A pixel with any value that
// is not finite is left out, and so is one whose weight is not above 0. Blocks may hang over the
// border; moments[0] then says how much of the block there was.
//
// Defines: those of the headers.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "products.h"

// One work-item per block: global size (pitch, h). Every pixel is read once.
kernel void moments(
    int width, int height, int h, int pitch, global const target_t *target, GUIDE_PARAMETERS,
    global const weight_t *weight, constant float *shift, global float *moments)
{
    const int bx = get_global_id(0), by = get_global_id(1);
    if (bx >= pitch || by >= h) return;

    real sums[K];
#pragma unroll
    for (int k = 0; k < K; ++k) sums[k] = 0;

    const int top = by * BLOCK, bottom = MIN(top + BLOCK, height);
    const int left = bx * BLOCK, right = MIN(left + BLOCK, width);
    for (int row = top; row < bottom; ++row) {
        for (int x0 = left; x0 < left + BLOCK; x0 += WIDTH) {
            const long pixel = (long)row * width + x0;
            const int last = MIN(right - x0, WIDTH) - 1;
            real x[Q + 1], y[C];
            const real one =
                read_usable(target, GUIDE_IMAGES, weight, shift, pixel, last, x, y);
            // Divided before they are summed: radiance near the largest float must not overflow.
#pragma unroll
            for (int c = 0; c < C; ++c) y[c] *= 1.0f / (BLOCK * BLOCK);
            add_products(sums, one, x, y);
        }
    }
#pragma unroll
    for (int k = 0; k < K; ++k)
        moments[((long)k * h + by) * pitch + bx] =
            lane_sum(sums[k]) * (k < XY(0, 0) ? 1.0f / (BLOCK * BLOCK) : 1);
}
