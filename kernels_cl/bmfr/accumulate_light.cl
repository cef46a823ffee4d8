// SPDX-License-Identifier: Apache-2.0
// BMFR, phase I: the mean of the noisy samples at each place, with an age limit (Koskela et al. 2019,
// section 3.2).
//
// Define beside those of the headers: MOST, the largest count.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "bmfr/taps.h"
#include "temporal/surface.h"

// Global size (W / WIDTH, H). All images (H, W, 3), but motion (H, W, 2), surface, depth, count
// and accepted (H, W). surface: above 0 where samples count. before_...: of the previous frame; where
// its count is 0 nothing is taken from it. accepted: bit i for tap i, for phase III.
kernel void accumulate_light(
    int width, int height, SURFACE_PARAMETERS, float least, global const float *sample,
    global const float *surface, global const float *before_count,
    global const float *before_light, global float *light, global float *count,
    global uchar *accepted)
{
    const int x = FIRST_PIXEL(width), y = get_global_id(1);
    if ((int)get_global_id(0) * WIDTH >= width || y >= height) return;
    const long pixel = (long)y * width + x;
    Taps taps = surface_taps(x, y, width, height, SURFACES);
    mask accepts = 0;
    real samples = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const real known = at(before_count, 1, 0, taps.pixel[i], taps.together[i]);
        const mask accept = (known > 0) & (taps.weight[i] > 0);
        taps.weight[i] = accept ? taps.weight[i] : (real)0;
        accepts |= accept ? (mask)(1 << i) : (mask)0;
        samples += taps.weight[i] * known;
    }
    const real total = normalise(&taps);
    samples = nearest(samples / (total > 0 ? total : (real)1));

    real own[3], mean[3];
#pragma unroll
    for (int c = 0; c < 3; ++c) own[c] = OWN(sample, 3, c);
    const mask usable =
        (0 * own[0] + 0 * own[1] + 0 * own[2] == 0) & (READ(surface + pixel) > 0);
    samples = MIN(samples + (usable ? (real)1 : (real)0), MOST);
    const real weight = 1 / MAX(samples, 1), share = MAX(weight, least);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        mean[c] = gather(before_light, 3, c, &taps);
        mean[c] += usable ? share * (own[c] - mean[c]) : (real)0;
    }
    write_pixels(light + pixel * 3, mean, 0, WIDTH - 1);
    WRITE(samples, count + pixel);
#define WRITE_BITS(i) (accepted[pixel + (i)] = LANE(accepts, i))
    (void)LANES(mask, WRITE_BITS);
}
