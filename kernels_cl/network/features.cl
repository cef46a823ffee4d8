// SPDX-License-Identifier: Apache-2.0
// What the network reads of every pixel and of the means over 2 x 2 of them, in maps at half of the
// resolution: 2 x 2 pixels side by side as channels (jflnr/network/features.py, unet.pack).
//
// Defines beside those of the headers: DARK; PICTURE where whole pictures are read.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "grids.h"
#include "network/maps.h"
#include "network/read.h"
#ifdef PICTURE
#include "network/picture.h"
#else
#include "network/light.h"
#endif

// map: 4 PIXEL + POOLED channels. means: a map of MEANS channels. Both have h x w blocks of 2 x 2
// pixels.
// Global size ((pitch - MARGIN) / WIDTH, h).
kernel void features(
    int width, int height, int h, int w, int pitch, IMAGE_PARAMETERS, global float *map,
    global float *means)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= w || y >= h) return;
    real sums[MEANS];
#pragma unroll
    for (int k = 0; k < MEANS; ++k) sums[k] = 0;
    map += MAP_AT(x, y, pitch, 4 * PIXEL + POOLED, 0);
    for (int dy = 0; dy < 2; ++dy) {
        real values[2][PIXEL], taken[2][MEANS];
#pragma unroll
        for (int half_of = 0; half_of < 2; ++half_of)
            of_pixels(
                2 * x + half_of * WIDTH, 2 * y + dy, width, height, IMAGES, values[half_of],
                taken[half_of]);
        global float *to = map + (long)dy * 2 * PIXEL * pitch;
#pragma unroll
        for (int k = 0; k < PIXEL; ++k) {
            WRITE(EVEN(values[0][k], values[1][k]), to + (long)k * pitch);
            WRITE(ODD(values[0][k], values[1][k]), to + (long)(PIXEL + k) * pitch);
        }
#pragma unroll
        for (int k = 0; k < MEANS; ++k)
            sums[k] += EVEN(taken[0][k], taken[1][k]) + ODD(taken[0][k], taken[1][k]);
    }
    means += MAP_AT(x, y, pitch, MEANS, 0);
#pragma unroll
    for (int k = 0; k < MEANS; ++k) {
        sums[k] *= 0.25f;
        WRITE(sums[k], means + (long)k * pitch);
    }
    write_means(sums, 0.25f, pitch, map + 4L * PIXEL * pitch);
}
