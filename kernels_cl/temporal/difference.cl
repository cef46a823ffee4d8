// SPDX-License-Identifier: Apache-2.0
// The difference between a new frame and the history, ready for moments.cl: host side in
// jflnr/opencl/temporal_change.py, twin in jflnr/temporal/change.py.
//
// Everything is in units of the mean brightness of the history.

#include "vectors.h"
#include "sizes.h"
#include "images.h"

// That mean, 1 where there is next to no light. First sums along rows, (H, 2): global size (H).
kernel void unit_rows(
    int width, int height, global const float *expected, global const float *known,
    global float *rows)
{
    const int y = get_global_id(0);
    if (y >= height) return;
    real light = 0, count = 0;
    float rest_light = 0, rest_count = 0;
    const float share = 1.0f / width;  // so that no sum is larger than its largest number
    global const float *e = expected + (long)y * width, *k = known + (long)y * width;
    int x = 0;
    for (; x + WIDTH <= width; x += WIDTH) {
        light += READ(e + x) * (READ(k + x) * share);
        count += READ(k + x) * share;
    }
    for (; x < width; ++x) {
        rest_light += e[x] * (k[x] * share);
        rest_count += k[x] * share;
    }
    rows[2 * y] = lane_sum(light) + rest_light;
    rows[2 * y + 1] = lane_sum(count) + rest_count;
}

// One work-item.
kernel void unit(int height, global const float *rows, global float *unit)
{
    if (get_global_id(0) > 0) return;
    float light = 0, count = 0;
    for (int y = 0; y < height; ++y) {
        light += rows[2 * y] / height;
        count += rows[2 * y + 1] / height;
    }
    const float mean = light / MAX(count, 1e-12f);
    unit[0] = mean > 1e-30f ? mean : 1;
}

// Five channels, so that the moments of all that is needed are those of one image: the difference d,
// weight l^2 with l the brightness of d, and the brightness of the history.
// None is above `brightest`.
//
// Compiled with C = 5. sample, light: (H, W, 3). weight: (H, W). Global size (W / WIDTH, H).
#define OWN(image, c) target_lanes((image) + pixel * 3, 3, c, 0, WIDTH - 1)
kernel void difference(
    int width, int height, float offset, float brightest, global const float *sample,
    global const float *light, global const float *expected, global const float *known,
    global const float *unit, global float *target, global float *weight)
{
    const int x = MIN((int)get_global_id(0) * WIDTH, width - WIDTH), y = get_global_id(1);
    if ((int)get_global_id(0) * WIDTH >= width || y >= height) return;
    const long pixel = (long)y * width + x;
    const float per_unit = 1 / unit[0];
    real values[5], l = 0;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        values[c] = OWN(sample, c) - OWN(light, c);
        l += BRIGHTNESS(c) * values[c];
    }
    const mask usable = 0 * l == 0;
    l = 0;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        values[c] *= per_unit;
        values[c] = CLAMP(values[c], -brightest, brightest);
        l += BRIGHTNESS(c) * values[c];
    }
    real luminance = READ(expected + pixel) * per_unit;
    luminance = CLAMP(luminance, 0, brightest);
    real w = READ(known + pixel) / (luminance + offset);
    w = usable ? w : (real)0;
#pragma unroll
    for (int c = 0; c < 3; ++c) values[c] = usable ? values[c] : (real)0;
    values[3] = usable ? w * l * l : (real)0;
    values[4] = luminance;
    write_pixels(target + pixel * 5, values, 0, WIDTH - 1);
    WRITE(w, weight + pixel);
}
