// SPDX-License-Identifier: Apache-2.0
// The values about which kernel 1 takes its moments.
//
// Defines: those of the headers.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "products.h"

// The typical values `shift` about which the moments are taken, since in float the variance of a
// guide far from zero would drown in the square of its mean: the mean over every step_y-th row and
// step_x-th column, of what is there and less than FARTHEST. Any other value gives the same model.

// One work-item per sampled row: sum and count of each guide go to partial (rows, Q, 2).
kernel void centre_rows(
    int width, int rows, int step_x, int step_y, GUIDE_PARAMETERS, global const weight_t *weight,
    global float *partial)
{
    const int row = get_global_id(0);
    if (row >= rows) return;
    for (int q = 0; q < Q; ++q) {
        float sum = 0, count = 0;
        for (int x = 0; x < width; x += step_x) {
            const long pixel = (long)row * step_y * width + x;
            const float value = guide_value(GUIDE_IMAGES, q, pixel);
            int counts = value < FARTHEST && value > -FARTHEST;
#ifdef WEIGHTED
            counts = counts && weight[pixel] > 0;
#endif
            sum += counts ? value : 0;
            count += counts;
        }
        partial[(row * Q + q) * 2] = sum;
        partial[(row * Q + q) * 2 + 1] = count;
    }
}

// One work-item per guide.
kernel void centre(int rows, global const float *partial, global float *shift)
{
    const int q = get_global_id(0);
    if (q >= Q) return;
    float sum = 0, count = 0;
    for (int row = 0; row < rows; ++row) {
        sum += partial[(row * Q + q) * 2];
        count += partial[(row * Q + q) * 2 + 1];
    }
    shift[q] = sum / MAX(count, 1);
}
