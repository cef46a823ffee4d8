// SPDX-License-Identifier: Apache-2.0
// BMFR, phase III: the mean of the fitted light over time, multiplied by albedo (Koskela et al. 2019,
// section 3.5).

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "bmfr/taps.h"
#include "bmfr/colours.h"

#define BITS(i) accepted[pixel + (i)]

// Global size (W / WIDTH, H). All images (H, W, 3), but motion (H, W, 2), count and accepted (H, W).
// accepted, count: from phase I. picture: (3, H, W), luma, orange and green.
kernel void accumulate_fitted(
    int width, int height, float least, global const float *fitted, global const float *albedo,
    global const float *motion, global const uchar *accepted, global const float *count,
    global const float *before_mean, global float *mean, global float *picture)
{
    const int x = FIRST_PIXEL(width), y = get_global_id(1);
    if ((int)get_global_id(0) * WIDTH >= width || y >= height) return;
    const long pixel = (long)y * width + x, plane = (long)height * width;
    Taps taps = find_taps(OWN(motion, 2, 0), OWN(motion, 2, 1), x, y, width, height);
    const mask accepts = LANES(mask, BITS);
#pragma unroll
    for (int i = 0; i < 4; ++i)
        taps.weight[i] = (accepts & (1 << i)) != 0 ? taps.weight[i] : (real)0;
    const real seen = normalise(&taps), weight = 1 / MAX(READ(count + pixel), 1);
    const real share = seen > 0 ? MAX(weight, least) : (real)1;
    real mixed[3], colour[3];
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        mixed[c] = gather(before_mean, 3, c, &taps);
        mixed[c] += share * (OWN(fitted, 3, c) - mixed[c]);
        colour[c] = usable_albedo(OWN(albedo, 3, c)) * mixed[c];
    }
    write_pixels(mean + pixel * 3, mixed, 0, WIDTH - 1);
    to_ycocg(colour);
#pragma unroll
    for (int c = 0; c < 3; ++c) WRITE(colour[c], picture + c * plane + pixel);
}
