// SPDX-License-Identifier: Apache-2.0
// The result scaled so that its brightness sums to the input's within `slack`, over the pixels that
// count, those whose input is finite and whose weight is above 0.
//
// Defines: those of the headers, with Q = 0: what guide_lanes reads here is the image.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "products.h"

// partial (H, 2): brightness of each row of the target and of the image, (H, W, C). Global size (H).
kernel void energy_rows(
    int width, int height, global const target_t *target, global const guide_t *image,
    global const weight_t *weight, global float *partial)
{
    const int row = get_global_id(0);
    if (row >= height) return;
    real before = 0, after = 0;
    for (int x0 = 0; x0 < width; x0 += WIDTH) {
        const long pixel = (long)row * width + x0;
        const int last = MIN(width - x0, WIDTH) - 1;
        real y[C], light = 0, output = 0;
        for (int c = 0; c < C; ++c) {
            y[c] = target_lanes(target + pixel * C, C, c, 0, last);
            light += BRIGHTNESS(c) * y[c];
            output += BRIGHTNESS(c) * guide_lanes(image + pixel * C, C, c, 0, last);
        }
        const mask counts = usable(weight, pixel, last, y, y) > 0;
        before += counts ? light : (real)0;
        after += counts ? output : (real)0;
    }
    partial[2 * row] = lane_sum(before);
    partial[2 * row + 1] = lane_sum(after);
}

// ratio: what the image is to be multiplied by. One work-item.
kernel void energy_ratio(
    int height, float slack, global const float *partial, global float *ratio)
{
    if (get_global_id(0) > 0) return;
    float before = 0, after = 0;
    for (int row = 0; row < height; ++row) {
        before += partial[2 * row];
        after += partial[2 * row + 1];
    }
    const float wanted = CLAMP(after, (1 - slack) * before, (1 + slack) * before);
    ratio[0] = after > 0 ? wanted / after : 1;
}

// count: numbers in the image. Global size (count / WIDTH, rounded up).
kernel void rescale(
    int count, global const float *ratio, global const float *image, global output_t *output)
{
    const int start = (int)get_global_id(0) * WIDTH;
    for (int i = start; i < MIN(start + WIDTH, count); ++i) {
        const real value = ratio[0] * image[i];
        const output_vector lanes = FROM_REAL(value);
        output[i] = LANE(lanes, 0);
    }
}
