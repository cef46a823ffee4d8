// Adaptive FLR: finer and coarser models put together by how much of their difference d is signal.
//
//   share = max(mean(d^2) - caution N, 0) / mean(d^2),   N = what noise alone would make of d^2
//   merged = coarser merged + share (fine - coarse)
//
// with everything coarse interpolated to the finer grid, and means taken under the window of the
// coarser grid. jflnr/flr/merge.py says why.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "window.h"

#define COARSE(plane) doubled(plane, coarse_h, coarse_w, coarse_pitch, x, y)

// d^2 and N, both relative to a squared brightness, and 1 where there are pixels: signal (3, h, pitch).
// light, coarse_light: (Q + 2, h, pitch) from `fit`. features, moments: (.., h, STRIDE(pitch)).
// Global size (pitch / WIDTH, h).
kernel void signal(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, float guide_scale,
    global const float *mean, global const float *moments, global const float *features,
    global const float *light, global const float *coarse_light, global float *signal)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const long plane = (long)h * pitch, block = (long)y * pitch + x;
    const long wide_plane = (long)h * STRIDE(pitch), wide = (long)y * STRIDE(pitch) + MARGIN + x;
    const long coarse_plane = (long)coarse_h * coarse_pitch;
    light += block;
    features += wide;
    real d = READ(light) - COARSE(coarse_light);
    for (int q = 0; q < Q; ++q) {
        const real slope = READ(light + (q + 1) * plane) - COARSE(coarse_light + (q + 1) * coarse_plane);
        d += READ(features + q * wide_plane) / guide_scale * slope;
    }
    const real more = READ(light + (Q + 1) * plane) - COARSE(coarse_light + (Q + 1) * coarse_plane);
    const real level = READ(features + (Q + 1) * wide_plane);
    const real reference = level * level + 0.01f * mean[0] * mean[0];
    const mask there = READ(moments + wide) > 1e-12f;
    signal += block;
    WRITE(there ? d * d / reference : (real)0, signal);
    WRITE(there ? MAX(more, 0) / reference : (real)0, signal + plane);
    WRITE(there ? (real)1 : (real)0, signal + 2 * plane);
}

// The window over the three planes, of the coarser grid: along rows, then along columns to the share.
// halved: (3, h, STRIDE(pitch)). rows: (3, h, pitch). Global size (pitch / WIDTH, h).
kernel void share_rows(
    int h, int pitch, float sigma, global const float *features, global const float *halved,
    global float *rows)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const long plane = (long)h * STRIDE(pitch), block = (long)y * STRIDE(pitch) + MARGIN + x;
    real weights[TAPS];
    row_weights(features + block, plane, sigma, weights);
    for (int k = 0; k < 3; ++k) {
        real sum = 0;
#pragma unroll
        for (int t = 0; t < TAPS; ++t)
            sum += weights[t] * READ(halved + k * plane + block + t - REACH);
        WRITE(sum, rows + ((long)k * h + y) * pitch + x);
    }
}

kernel void share_columns(
    int h, int pitch, float sigma, float caution, global const float *features,
    global const float *rows, global float *share)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const long plane = (long)h * STRIDE(pitch), block = (long)y * STRIDE(pitch) + MARGIN + x;
    int to_row[TAPS];
    real weights[TAPS], sums[3];
    column_weights(features + block, plane, STRIDE(pitch), y, h, sigma, to_row, weights);
#pragma unroll
    for (int k = 0; k < 3; ++k) {
        sums[k] = 0;
#pragma unroll
        for (int t = 0; t < TAPS; ++t)
            sums[k] += weights[t] * READ(rows + ((long)k * h + y + to_row[t]) * pitch + x);
    }
    const real total = MAX(sums[0], 1e-9f * sums[2]), signal = sums[0] - caution * sums[1];
    WRITE(total > 0 ? MAX(signal, 0) / total : (real)0, share + (long)y * pitch + x);
}

// model, merged: (Q + 1, C, h, pitch). coarse, coarse_merged: the same of the coarser grid. share:
// (coarse_h, coarse_pitch). light: (Q + 1, h, pitch), the merged models of the brightness.
// Global size (pitch / WIDTH, h).
kernel void merge(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, global const float *model,
    global const float *coarse, global const float *coarse_merged, global const float *share,
    global float *merged, global float *light)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const long plane = (long)h * pitch, block = (long)y * pitch + x;
    const long coarse_plane = (long)coarse_h * coarse_pitch;
    const real part = COARSE(share);
    for (int q = 0; q <= Q; ++q) {
        real brightness = 0;
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const int i = q * C + c;
            const real step = READ(model + i * plane + block) - COARSE(coarse + i * coarse_plane);
            const real sum = COARSE(coarse_merged + i * coarse_plane) + part * step;
            WRITE(sum, merged + i * plane + block);
            brightness += BRIGHTNESS(c) * sum;
        }
        WRITE(brightness, light + q * plane + block);
    }
}
