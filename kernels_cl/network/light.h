// SPDX-License-Identifier: Apache-2.0
// What the network reads of light (jflnr/network/features.py): for features.cl.
//
// Define: BRIGHTEST, above which no light is seen. light, error: (H, W, C) and (H, W) in float. mean:
// of the frame.

#include "products.h"

#define IMAGE_PARAMETERS                                                                       \
    global const target_t *target, GUIDE_PARAMETERS, global const weight_t *weight,            \
        global const float *light, global const float *error, global const float *mean
#define IMAGES target, GUIDE_IMAGES, weight, light, error, mean
#define PIXEL 15

#define OF_IMAGE(i) p[MIN(i, last) * stride + channel]
INLINE real image_lanes(global const float *p, int stride, int channel, int last)
{
    return LANES(real, OF_IMAGE);
}

// The PIXEL values of WIDTH pixels from (x, y) on, and what is averaged of them; zeros beyond the image
// and where a pixel does not count.
INLINE void of_pixels(
    int x, int y, int width, int height, IMAGE_PARAMETERS, real *values, real *means)
{
    const float unit = 1 / mean[0];
    const long pixel = (long)y * width + x;
    const int last = MIN(width - x, WIDTH) - 1;
    real denoised[3] = {0, 0, 0}, noisy[3] = {0, 0, 0}, guides[5] = {0, 0, 0, 0, 0}, wrong = 0;
    mask counts = 0;
    if (y < height && last >= 0) {
        real all[C], known[Q];
#pragma unroll
        for (int c = 0; c < C; ++c) {
            all[c] = target_lanes(target + pixel * C, C, c, 0, last);
            noisy[c % 3] += all[c];
            denoised[c % 3] += image_lanes(light + pixel * C, C, c, last);
        }
#pragma unroll
        for (int q = 0; q < Q; ++q) known[q] = read_guide(GUIDE_IMAGES, q, pixel, 0, last);
        counts = usable(weight, pixel, last, known, all) > 0;
#pragma unroll
        for (int q = 0; q < Q; ++q) {
            const real cut = CLAMP(known[q], q < 3 ? -1 : 0, q == 3 ? 100 : 1);
            guides[q] = counts ? cut : (real)0;
        }
        wrong = image_lanes(error + pixel, 1, 0, last);
    }
#if Q == 4
    guides[4] = counts ? (real)1 : (real)0;
#endif
#define SHOWN(v) (counts ? CLAMP((v) * unit, 0, BRIGHTEST) : (real)0)
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        means[c] = denoised[c] = SHOWN(denoised[c]);
        means[3 + c] = noisy[c] = SHOWN(noisy[c]);
    }
    wrong = SHOWN(wrong);
    const real before = luminance(denoised), after = luminance(noisy), bright = before + 0.05f;
    means[6] = MIN(after, 4 * before + 0.1f);
    means[7] = (after - before) * (after - before);

    values[0] = log_above_0(before + DARK);
    values[1] = 0.5f * CLAMP((after - before) / bright, -1, 4);
    values[2] = log_above_0(1 + (after + 0.05f) / bright);
    values[3] = log_above_0(wrong / bright + 0.01f) + 1.5f;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        values[4 + c] = log_above_0((denoised[c] + DARK) / (before + DARK));
        values[7 + c] = guides[c];
    }
    values[10] = log_above_0(guides[3] + 0.05f);
    values[11] = 2 * guides[4] - 1;
    values[12] = MIN(wrong, 3);
    values[13] = counts ? (real)1 : (real)0;
    values[14] = log_above_0(after + 0.03f);
}
