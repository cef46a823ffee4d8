// SPDX-License-Identifier: Apache-2.0
// Adaptive FLR: the light of every block, which is to show where its model falls too dark.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "models.h"

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
