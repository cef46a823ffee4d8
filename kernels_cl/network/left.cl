// SPDX-License-Identifier: Apache-2.0
// What is left of a noisy picture beside the denoised one, fireflies no brighter than that, and what
// shines, the brighter the more (`Read.left` and `Read.shining` of jflnr/network/picture.py).
//
// Defines: those of images.h, for C = 3 and no guides.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "planes.h"
#include "network/read.h"

// light, noisy: (H, W, 3). weight: (H, W). left: (3, H, W). shining: (4, H, W), light times luminance,
// and that. Global size (ceil(W / WIDTH), H).
kernel void left_over(
    int width, int height, global const float *light, global const float *noisy,
    global const float *weight, global float *left, global float *shining)
{
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x0 >= width || y >= height) return;
    const long pixel = (long)y * width + x0;
    const int last = MIN(width - x0, WIDTH) - 1;
    real before[3], after[3];
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        before[c] = guide_lanes(light + pixel * 3, 3, c, 0, last);
        after[c] = guide_lanes(noisy + pixel * 3, 3, c, 0, last);
    }
    const real counts = guide_lanes(weight + pixel, 1, 0, 0, last);
    const real bright = luminance(before);
    const real most = (4 * bright + 0.1f) / MAX(luminance(after), 1e-6f);
    const real share = counts * MIN(most, 1);
    const long plane = (long)height * width;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        const real rest = counts > 0 ? share * after[c] - before[c] : (real)0;
        write_lanes(left + c * plane + pixel, width, x0, rest);
        write_lanes(shining + c * plane + pixel, width, x0, before[c] * bright);
    }
    write_lanes(shining + 3 * plane + pixel, width, x0, bright);
}
