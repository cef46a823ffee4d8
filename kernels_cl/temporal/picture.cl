// SPDX-License-Identifier: Apache-2.0
// The history of whole pictures: host side in jflnr/opencl/temporal_picture.py, twin in
// jflnr/temporal/picture.py, which says why.
//
// Defines beside those of vectors.h and BRIGHTNESS_0 to 2: CHANNELS of a picture, 3 or 4; AROUND,
// pixels on each side that are compared; the numbers LEAST, EXPLAINED, DARK, LEAST_NOISE and MOST.

#include "vectors.h"

// Shares of four samples around a place that lies t behind the second of them.
INLINE void cubic(float t, float *share)
{
    share[0] = ((2 - t) * t - 1) * t / 2;
    share[1] = ((3 * t - 5) * t * t + 2) / 2;
    share[2] = ((4 - 3 * t) * t + 1) * t / 2;
    share[3] = (t - 1) * t * t / 2;
}

// planes: one over the certainty of what was, 0 where nothing is known; noise of the picture, below 0
// where it cannot be used; what the difference exceeds; 1 where that counts. (4, H, W).
// picture, past, moved: (H, W, CHANNELS). error, certainty: (H, W). motion: (H, W, 2). unit: mean of
// the picture. Global size (W, H).
kernel void compare(
    int width, int height, float unit, global const float *picture, global const float *error,
    global const float *motion, global const float *past, global const float *certainty,
    global float *moved, global float *planes)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    const long pixel = (long)y * width + x, plane = (long)height * width;

    float to_x = x + motion[2 * pixel], to_y = y + motion[2 * pixel + 1];
    const int inside = 2 * to_x + 1 >= 0 && 2 * to_x + 1 <= 2 * width && 2 * to_y + 1 >= 0 &&
                       2 * to_y + 1 <= 2 * height;
    to_x = inside ? to_x : 0;
    to_y = inside ? to_y : 0;
    const int left = (int)floor(to_x), top = (int)floor(to_y);
    float across[4], down[4], sums[CHANNELS], sure = 0;
    cubic(to_x - left, across);
    cubic(to_y - top, down);
    for (int c = 0; c < CHANNELS; ++c) sums[c] = 0;
    for (int j = 0; j < 4; ++j) {
        const long row = (long)CLAMP(top + j - 1, 0, height - 1) * width;
        for (int i = 0; i < 4; ++i) {
            const long tap = row + CLAMP(left + i - 1, 0, width - 1);
            const int near = i == 1 || i == 2, both = near && (j == 1 || j == 2);
            const float beside = (i == 1 ? 1 - (to_x - left) : to_x - left) *
                                 (j == 1 ? 1 - (to_y - top) : to_y - top);
            sure += both ? beside * certainty[tap] : 0;
            for (int c = 0; c < CHANNELS; ++c) {
                const float was = past[tap * CHANNELS + c];
                sums[c] += certainty[tap] > 0 && 0 * was == 0 ? across[i] * down[j] * was : 0;
            }
        }
    }

    int usable = 0 * error[pixel] == 0;
    for (int c = 0; c < CHANNELS; ++c) usable = usable && 0 * picture[pixel * CHANNELS + c] == 0;
    const int seen = inside && usable && sure > 0;
    float bright = DARK * unit, apart = 0;
    for (int c = 0; c < CHANNELS; ++c) {
        const float was = CLAMP(sums[c], 0, MOST), is = MAX(picture[pixel * CHANNELS + c], 0);
        moved[pixel * CHANNELS + c] = was;
        if (c >= 3) continue;
        bright += (c == 0 ? BRIGHTNESS_0 : c == 1 ? BRIGHTNESS_1 : BRIGHTNESS_2) * is;
        apart += (sqrt(was) - sqrt(is)) * (sqrt(was) - sqrt(is)) / 3;
    }
    const float slope = bright > 0 ? error[pixel] / (2 * sqrt(bright)) : 0;
    const float noise = MIN(slope * slope + LEAST_NOISE * unit + 1e-30f, MOST);
    const float old = seen ? 1 / sure : 0;
    planes[pixel] = old;
    planes[plane + pixel] = usable ? noise : -1;
    planes[2 * plane + pixel] = seen ? apart - EXPLAINED * (old + noise) : 0;
    planes[3 * plane + pixel] = seen;
}

// The average with one more picture in it, and how certain it is. Global size (W, H).
kernel void follow(
    int width, int height, global const float *picture, global const float *moved,
    global const float *planes, global float *mean, global float *certainty)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    const long pixel = (long)y * width + x, plane = (long)height * width;
    global const float *apart = planes + 2 * plane, *counts = apart + plane;
    float more = 0, count = 0;
    for (int v = MAX(y - AROUND, 0); v <= MIN(y + AROUND, height - 1); ++v)
        for (int u = MAX(x - AROUND, 0); u <= MIN(x + AROUND, width - 1); ++u) {
            more += apart[(long)v * width + u];
            count += counts[(long)v * width + u];
        }
    const float noise = planes[plane + pixel];
    const float old = MIN(planes[pixel] + MAX(more, 0) / MAX(count, 1), MOST);
    const int seen = counts[pixel] > 0, usable = noise >= 0;
    const float kept = seen ? MIN(noise / (old + noise), 1 - LEAST) : 0;
    for (int c = 0; c < CHANNELS; ++c) {
        const float is = picture[pixel * CHANNELS + c], shown = usable ? MAX(is, 0) : is;
        mean[pixel * CHANNELS + c] = shown + kept * (seen ? moved[pixel * CHANNELS + c] - shown : 0);
    }
    const float variance = (1 - kept) * (1 - kept) * noise + kept * kept * old;
    certainty[pixel] = usable ? 1 / variance : 0;
}
