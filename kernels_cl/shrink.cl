// SPDX-License-Identifier: Apache-2.0
// Means over factor x factor pixels, of those in the mask only: guides at the resolution of light that
// is smaller (section 3.2.1).
//
// Defines: those of images.h, for one image of C channels, with WIDTH = 1.

#include "vectors.h"
#include "sizes.h"
#include "images.h"

// image: (H, W, C). mask: (H, W) or NULL. means: (h, w, C). Global size (w, h).
kernel void shrink(
    int width, int height, int w, int factor, global const guide_t *image,
    global const float *mask, global float *means)
{
    const int x = get_global_id(0), y = get_global_id(1);
    const int right = MIN((x + 1) * factor, width), bottom = MIN((y + 1) * factor, height);
    if (x >= w || y * factor >= height) return;
    float sums[C], total = 0;
#pragma unroll
    for (int c = 0; c < C; ++c) sums[c] = 0;
    for (int row = y * factor; row < bottom; ++row)
        for (int column = x * factor; column < right; ++column) {
            const long pixel = (long)row * width + column;
            const float counts = mask ? mask[pixel] : 1;
            total += counts;
#pragma unroll
            for (int c = 0; c < C; ++c)
                sums[c] += counts * guide_lanes(image + pixel * C, C, c, 0, 0);
        }
#pragma unroll
    for (int c = 0; c < C; ++c)
        means[((long)y * w + x) * C + c] = sums[c] / MAX(total, 1e-6f);
}
