// What must be alike in a window of adaptive FLR.
//
// Define beside those of the headers: REFINES, 1 if there is a coarser grid.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"

// The features of the window, (Q + 2, h, STRIDE(pitch)): the mean guides of each block, times
// guide_scale. And, if REFINES, brightness_scale log(level / mean + 0.1) with the level of brightness
// that the coarser grids found, and that level itself.
//
// moments: (K, h, STRIDE(pitch)). light: (Q + 1, coarse_h, coarse_pitch), models of the brightness of
// the next coarser grid. Global size (STRIDE(pitch) / WIDTH, h).
kernel void features(
    int h, int w, int pitch, int coarse_h, int coarse_w, int coarse_pitch, float guide_scale,
    float brightness_scale, global const float *mean, global const float *moments,
    global const float *light, global float *features)
{
    const int column = (int)get_global_id(0) * WIDTH, x = column - MARGIN, y = get_global_id(1);
    if (column >= STRIDE(pitch) || y >= h) return;
    const long plane = (long)h * STRIDE(pitch), block = (long)y * STRIDE(pitch) + column;
    moments += block;
    features += block;
    const real n = READ(moments);
    const real per_pixel = n > 1e-12f ? 1 / n : (real)0;
#if REFINES
    const long light_plane = (long)coarse_h * coarse_pitch;
    const int inside = x >= 0 && x < w;
    real level = inside ? doubled(light, coarse_h, coarse_w, coarse_pitch, x, y) : (real)0;
#endif
    for (int q = 0; q < Q; ++q) {
        const real guide = READ(moments + XX(q + 1, 0) * plane) * per_pixel;
        WRITE(guide_scale * guide, features + q * plane);
#if REFINES
        if (inside)
            level += guide * doubled(light + (q + 1) * light_plane, coarse_h, coarse_w, coarse_pitch, x, y);
#endif
    }
#if REFINES
    level = MAX(level, 0);
    WRITE(brightness_scale * log(level / mean[0] + 0.1f), features + Q * plane);
    WRITE(level, features + (Q + 1) * plane);
#endif
}
