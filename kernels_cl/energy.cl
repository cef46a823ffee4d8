// SPDX-License-Identifier: Apache-2.0
// Adaptive FLR: the mean brightness of the frame, and keeping it in spite of the weights; the light of
// every block, which is to show where its model falls too dark.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "models.h"

// Sums in three steps, the same in any order of work-groups: rows, then their total.
#define SUM(index)                                        \
    float total_##index = 0;                              \
    for (int y = 0; y < h; ++y) total_##index += partial[2 * y + index];

// The moments of pass 1: partial (h, 2), how much there is of each row of blocks and its brightness.
// Global size (h).
kernel void light_rows(int h, int w, int pitch, global const float *moments, global float *partial)
{
    const int y = get_global_id(0);
    if (y >= h) return;
    global const float *n = moments + (long)y * pitch, *light = n + (long)XX(Q + 1, 0) * h * pitch;
    float pixels = 0, sum = 0;
    for (int x = 0; x < w; ++x) {
        pixels += n[x];
        sum += light[x];
    }
    partial[2 * y] = pixels;
    partial[2 * y + 1] = sum;
}

// mean: the frame's mean brightness, or 1 where there is no light, and the sum. One work-item.
kernel void light_mean(int h, global const float *partial, global float *mean)
{
    if (get_global_id(0) > 0) return;
    SUM(0)
    SUM(1)
    const float ratio = total_1 / MAX(total_0, 1e-12f);
    mean[0] = ratio > 0 ? ratio : 1;
    mean[1] = total_1;
}

// Brightness (h, pitch) of the merged models on the blocks of pass 1: the mean of 2 x 2 models, (fine_h,
// fine_pitch / GROUP, MODELS, GROUP) with fine_w columns, at the mean guides. Global size (w, h).
kernel void restored(
    int h, int w, int pitch, int fine_h, int fine_w, int fine_pitch, global const float *moments,
    global const float *models, global float *output)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= w || y >= h) return;
    const long block = (long)y * pitch + x, plane = (long)h * pitch;
    const int x_1 = MIN(2 * x + 1, fine_w - 1), y_1 = MIN(2 * y + 1, fine_h - 1);
    const long upper_left = AT(2 * x, 2 * y, fine_pitch, MODELS);
    const long upper_right = AT(x_1, 2 * y, fine_pitch, MODELS);
    const long lower_left = AT(2 * x, y_1, fine_pitch, MODELS);
    const long lower_right = AT(x_1, y_1, fine_pitch, MODELS);
    const float per_pixel = moments[block] > 1e-12f ? 1 / moments[block] : 0;
    float sum = 0;
    for (int q = 0; q <= Q; ++q) {
        global const float *light = models + LIGHT_PLANE(q) * GROUP;
        const float guide = q == 0 ? 1 : moments[XX(q, 0) * plane + block] * per_pixel;
        sum += guide * (light[upper_left] + light[upper_right] + light[lower_left] + light[lower_right]);
    }
    output[block] = MAX(sum / 4, 0);
}

// partial (h, 2): sums over each row of the brightness that is put out, and of its square.
kernel void restored_rows(
    int h, int w, int pitch, global const float *moments, global const float *output,
    global float *partial)
{
    const int y = get_global_id(0);
    if (y >= h) return;
    float sum = 0, squares = 0;
    for (int x = 0; x < w; ++x) {
        const float n = moments[(long)y * pitch + x], value = output[(long)y * pitch + x];
        sum += n * value;
        squares += n * value * value;
    }
    partial[2 * y] = sum;
    partial[2 * y + 1] = squares;
}

// rate: the models are to be multiplied by max(1 + rate * output, 0) block by block, so that the
// frame's sum comes within `slack` of the input's. One work-item.
kernel void restore(
    int h, float slack, global const float *partial, global const float *mean, global float *rate)
{
    if (get_global_id(0) > 0) return;
    SUM(0)
    SUM(1)
    const float wanted = CLAMP(total_0, (1 - slack) * mean[1], (1 + slack) * mean[1]);
    rate[0] = (wanted - total_0) / (total_1 > 0 ? total_1 : 1);
}

// own: (h, pitch / GROUP, C, GROUP), what the models give at the mean guides of their blocks; 0 where
// its brightness would be below zero. moments: K + 1 planes. Global size (pitch / WIDTH, h).
kernel void own_light(
    int h, int pitch, global const float *moments, global const float *models, global float *own)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    moments += AT(x, y, pitch, K + 1);
    models += AT(x, y, pitch, MODELS);
    own += AT(x, y, pitch, C);
    const real n = READ(moments);
    const real per_pixel = n > 1e-12f ? 1 / n : (real)0;
    real values[C];
    for (int c = 0; c < C; ++c) values[c] = READ(models + c * GROUP);
    for (int q = 1; q <= Q; ++q) {
        const real guide = READ(moments + XX(q, 0) * GROUP) * per_pixel;
        for (int c = 0; c < C; ++c) values[c] += guide * READ(models + (q * C + c) * GROUP);
    }
    real light = 0;
    for (int c = 0; c < C; ++c) light += BRIGHTNESS(c) * values[c];
    for (int c = 0; c < C; ++c) WRITE(light > 0 ? values[c] : (real)0, own + c * GROUP);
}
