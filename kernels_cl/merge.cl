// SPDX-License-Identifier: Apache-2.0
// Adaptive FLR: finer and coarser models put together by how much of their difference d is signal.
//
//   share = max(mean(d^2) - caution N, 0) / mean(d^2),   N = what noise alone would make of d^2
//   merged = coarser merged + share (fine - coarse)
//
// with everything coarse interpolated to the finer grid, and means taken under the window of the
// coarser grid. jflnr/regression/merge.py says why.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "window.h"
#include "models.h"

// The three planes of `signal`, (h, pitch / GROUP, 3, GROUP): d^2 and N, both relative to a squared
// brightness, and 1 where there are pixels.
//
// moments: K + 1 planes. fine, coarse: models. features: of the finer grid, all Q + 2.
// Global size (pitch / WIDTH, h).
kernel void signal(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, float guide_scale,
    global const uchar *tiles, global const float *mean, global const float *moments, global const float *features,
    global const float *fine, global const float *coarse, global float *signal)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    features += AT(x, y, pitch, Q + 2);
    fine += AT(x, y, pitch, MODELS);
    signal += AT(x, y, pitch, 3);
    if (!refined(tiles, h, pitch, x, y, 0, 0)) {
        WRITE((real)0, signal);
        WRITE((real)0, signal + GROUP);
        WRITE((real)1, signal + 2 * GROUP);
        return;
    }
    for (int q = 0; q <= Q + 1; ++q) EXPECT_BLOCK(fine + LIGHT_PLANE(q) * GROUP, MODELS);
    const coarse_t at = coarse_at(coarse, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    real d = READ(fine + LIGHT_PLANE(0) * GROUP) - doubled(&at, LIGHT_PLANE(0));
    for (int q = 0; q < Q; ++q) {
        const real slope =
            READ(fine + LIGHT_PLANE(q + 1) * GROUP) - doubled(&at, LIGHT_PLANE(q + 1));
        d += READ(features + q * GROUP) / guide_scale * slope;
    }
    const real more = READ(fine + VARIANCE * GROUP) - doubled(&at, VARIANCE);
    const real luminance = READ(features + (Q + 1) * GROUP);
    const real reference = luminance * luminance + 0.01f * mean[0] * mean[0] + 1e-30f;
    const mask there = READ(moments + AT(x, y, pitch, K + 1)) > 1e-12f;
    WRITE(there ? d * d / reference : (real)0, signal);
    WRITE(there ? MAX(more, 0) / reference : (real)0, signal + GROUP);
    WRITE(there ? (real)1 : (real)0, signal + 2 * GROUP);
}

// The window of the coarser grid over the three planes: along rows, then along columns to the share.
// halved, rows: (h, pitch / GROUP, 3, GROUP). share: (h, pitch). Global size (pitch / WIDTH, h).
kernel void share_rows(
    int h, int pitch, int refines, float sigma, global const float *features, global const float *halved,
    global float *rows)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    real weights[TAPS];
    row_weights(features, refines, x, y, pitch, sigma, weights);
    const long block = AT(x, y, pitch, 3);
    for (int k = 0; k < 3; ++k) {
        global const float *p = halved + block + k * GROUP;
        real sum = 0;
        FOR_TAPS(p, 3, ADD_WEIGHTED)
        WRITE(sum, rows + block + k * GROUP);
    }
}

kernel void share_columns(
    int h, int pitch, int refines, float sigma, float caution, global const float *features,
    global const float *rows, global float *share)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    int to_row[TAPS];
    real weights[TAPS], sums[3];
    column_weights(features, refines, x, y, h, pitch, sigma, to_row, weights);
    rows += AT(x, y, pitch, 3);
#pragma unroll
    for (int k = 0; k < 3; ++k) {
        sums[k] = 0;
#pragma unroll
        for (int t = 0; t < TAPS; ++t)
            sums[k] += weights[t] * READ(rows + k * GROUP + (long)to_row[t] * pitch * 3);
    }
    const real total = MAX(sums[0], 1e-9f * sums[2]), signal = sums[0] - caution * sums[1];
    WRITE(sums[2] > 1e-12f ? MAX(signal, 0) / total : (real)0, share + AT(x, y, pitch, 1));
}

// fine, coarse, coarse_merged, merged: models. share: of the coarser grid.
// Global size (pitch / WIDTH, h).
kernel void merge(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, global const uchar *tiles,
    global const float *fine, global const float *coarse, global const float *coarse_merged,
    global const float *share, global float *merged)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    if (!refined(tiles, h, pitch, x, y, 0, 0)) {
        const coarse_t before =
            coarse_at(coarse_merged, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
        merged += AT(x, y, pitch, MODELS);
        for (int k = 0; k < VARIANCE; ++k) WRITE(doubled(&before, k), merged + k * GROUP);
        return;
    }
    const coarse_t share_at = coarse_at(share, 1, coarse_h, coarse_w, coarse_pitch, x, y);
    const real part = doubled(&share_at, 0);
    merge_models(
        VARIANCE, x, y, pitch, coarse_h, coarse_w, coarse_pitch, fine, coarse, coarse_merged, part,
        merged);
}
