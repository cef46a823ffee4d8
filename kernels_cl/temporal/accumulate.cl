// SPDX-License-Identifier: Apache-2.0
// An average that follows the light, with one more frame in it, and one of guides beside it: host side
// in jflnr/opencl/temporal.py, twins in jflnr/temporal/accumulate.py and sequence.py.

#include "vectors.h"
#include "sizes.h"
#include "images.h"

#define OWN(image, c) target_lanes((image) + pixel * 3, 3, c, 0, WIDTH - 1)

#ifdef AROUND
#define LIGHT_OF(p) (BRIGHTNESS_0 * (p)[0] + BRIGHTNESS_1 * (p)[1] + BRIGHTNESS_2 * (p)[2])
// Twin of `bounded` in jflnr/temporal/newly_seen.py, of one pixel: what its light is multiplied by.
INLINE float bound(
    global const float *image, global const float *known, global const float *counted,
    global const float *depth, long pixel, int width, int pixels)
{
    const int x = pixel % width, y = pixel / width, height = pixels / width;
    const float own = LIGHT_OF(image + pixel * 3), far = depth[pixel];
    float total = 0, sum = 0, seen = 0;
    if (known[pixel] > 0 || !(own > 0)) return 1;
    for (int v = MAX(y - AROUND, 0); v <= MIN(y + AROUND, height - 1); ++v)
        for (int u = MAX(x - AROUND, 0); u <= MIN(x + AROUND, width - 1); ++u) {
            const long other = (long)v * width + u;
            const float apart = depth[other] - far;
            if (counted[other] > 0 && MAX(apart, -apart) < NEAR * far) {
                seen += known[other];
                total += counted[other];
                sum += counted[other] * LIGHT_OF(image + other * 3);
            }
        }
    const float mean = seen > 0 ? sum / total : own;
    return CLAMP(own, mean / BRIGHTER, mean * BRIGHTER) / own;
}
#endif

// Global size (ceil(pixels / WIDTH)); pixels is at least WIDTH. before, signal, image, mean: (pixels, 3).
// All else (pixels), but for before_guides and mean_guides, (pixels, Q). signal: in units. least: of a
// new frame. weight: what a pixel weighs in a fit, by its samples and surface, 0 where that is not
// above 0. Defines: MODEL, how wrong a model is, in variances of one frame. AROUND, NEAR, BRIGHTER, for
// an image whose new pixels are to be bounded: with width, known, 1 where there is a history, counted,
// what pixels weigh, and depth.
kernel void accumulate(
    int pixels, int width, float least, global const float *unit, global const float *before,
    global const float *before_samples, global const float *signal, global const float *noise,
    global const float *image, global const float *surface, global const float *before_guides,
    GUIDE_PARAMETERS, global const float *known, global const float *counted,
    global const float *depth, global float *mean, global float *samples, global float *weight,
    global float *mean_guides)
{
    if ((long)get_global_id(0) * WIDTH >= pixels) return;
    const long pixel = MIN((long)get_global_id(0) * WIDTH, (long)pixels - WIDTH);
    const real old = READ(before_samples + pixel);
    const real n = old / (1 + READ(noise + pixel) * old), equal = 1 / (n + 1);
    const real share = MAX(equal, least);
    real own[3], mixed[3];
#pragma unroll
    for (int c = 0; c < 3; ++c) own[c] = OWN(image, c);
#ifdef AROUND
#define BOUND(i) bound(image, known, counted, depth, pixel + (i), width, pixels)
    if (lane_sum(READ(known + pixel)) < WIDTH) {
        const real bounds = LANES(real, BOUND);
#pragma unroll
        for (int c = 0; c < 3; ++c) own[c] *= bounds;
    }
#endif
    mask good = 0 * own[0] + 0 * own[1] + 0 * own[2] == 0;
#if Q > 0
    real guide[Q], mixed_guide[Q];
#pragma unroll
    for (int q = 0; q < Q; ++q) {
        guide[q] = read_guide(GUIDE_IMAGES, q, pixel, 0, WIDTH - 1);
        good &= 0 * guide[q] == 0;
    }
#pragma unroll
    for (int q = 0; q < Q; ++q) {
        const real kept = target_lanes(before_guides + pixel * Q, Q, q, 0, WIDTH - 1);
        mixed_guide[q] = kept + (good ? share * (guide[q] - kept) : (real)0);
    }
    write_guides(mean_guides + pixel * Q, mixed_guide);
#endif
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        const real kept = OWN(before, c) + unit[0] * OWN(signal, c);
        mixed[c] = n > 0 ? kept : (real)0;
        mixed[c] += good ? share * (own[c] - mixed[c]) : (real)0;
    }
    const real divisor = n > 0 ? n : (real)1;
    const real kept = n > 0 ? (1 - share) * (1 - share) / divisor : (real)0;
    const real count = good ? 1 / (kept + share * share) : n;
    write_pixels(mean + pixel * 3, mixed, 0, WIDTH - 1);
    WRITE(count, samples + pixel);
    const real counts = READ(surface + pixel);
    const real weighs = counts * (1 + MODEL) * count / (1 + MODEL * count);
    WRITE(counts > 0 ? weighs : (real)0, weight + pixel);
}
