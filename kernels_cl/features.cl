// What must be alike in a window of adaptive FLR.
//
// Define beside those of the headers: REFINES, 1 if there is a coarser grid; COUNT, the number of planes
// of moments.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "models.h"

#define FEATURE_PLANES (Q + 2 * REFINES)

// features: the mean guides of each block, times guide_scale. And, if REFINES, brightness_scale
// log(luminance / mean + 0.1) with the luminance that the coarser grids found, and that level.
//
// found: models of the next coarser grid. Global size (pitch / WIDTH, h).
kernel void features(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, float guide_scale,
    float brightness_scale, global const float *mean, global const float *moments,
    global const float *found, global float *features)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    moments += AT(x, y, pitch, COUNT);
    features += AT(x, y, pitch, FEATURE_PLANES);
    for (int q = 0; q <= Q; ++q) EXPECT_BLOCK(moments + XX(q, 0) * GROUP, COUNT);
    const real n = READ(moments);
    const real per_pixel = n > 1e-12f ? 1 / n : (real)0;
#if REFINES
    const coarse_t coarse = coarse_at(found, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    real luminance = doubled(&coarse, LIGHT_PLANE(0));
#endif
    for (int q = 0; q < Q; ++q) {
        const real guide = READ(moments + XX(q + 1, 0) * GROUP) * per_pixel;
        WRITE(guide_scale * guide, features + q * GROUP);
#if REFINES
        luminance += guide * doubled(&coarse, LIGHT_PLANE(q + 1));
#endif
    }
#if REFINES
    luminance = MAX(luminance, 0);
    WRITE(brightness_scale * log(luminance / mean[0] + 0.1f), features + Q * GROUP);
    WRITE(luminance, features + (Q + 1) * GROUP);
#endif
}
