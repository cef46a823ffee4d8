// SPDX-License-Identifier: Apache-2.0
// What tells surfaces apart; the twin of `_alike` in jflnr/temporal/reproject.py. Comes after
// bmfr/taps.h.
//
// Define: DEPTHS, if the frames have no position; surfaces are then told apart by their depth.

#define DOT(a, b) ((a)[0] * (b)[0] + (a)[1] * (b)[1] + (a)[2] * (b)[2])

typedef struct {
    real normal[3], position[3], depth;
} Surface;

// Of the pixels of a frame, or of any pixels.
INLINE Surface surface_at(
    global const float *normal, global const float *depth, global const float *position, mask pixels,
    int together)
{
    Surface found;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        found.normal[c] = at(normal, 3, c, pixels, together);
        found.position[c] = at(position, 3, c, pixels, together);
    }
    found.depth = at(depth, 1, 0, pixels, together);
    return found;
}

// Of the work-item's own pixels.
INLINE Surface surface_here(
    global const float *normal, global const float *depth, global const float *position, long pixel)
{
    Surface found;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        found.normal[c] = OWN(normal, 3, c);
        found.position[c] = OWN(position, 3, c);
    }
    found.depth = READ(depth + pixel);
    return found;
}

// Whether two pixels show one surface. tolerance: in scene units.
INLINE mask alike(Surface here, Surface there, real tolerance, float same_normal, float cosine)
{
#ifdef DEPTHS
    const real apart = there.depth - here.depth;
#else
#pragma unroll
    for (int c = 0; c < 3; ++c) there.position[c] -= here.position[c];
    const real apart = DOT(here.normal, there.position);
#endif
    const real product = DOT(here.normal, there.normal);
    const mask turned = (product < same_normal) | (product > cosine);
    return (ABS(apart) <= tolerance) & (turned == 0) & (here.depth > 0) & (there.depth > 0);
}

// What taps follow from, as kernel arguments and handed on.
#define SURFACE_PARAMETERS                                                        \
    float off_plane, float same_normal, float cosine, global const float *motion, \
        global const float *normal, global const float *depth,                    \
        global const float *position, global const float *before_normal,          \
        global const float *before_depth, global const float *before_position
#define SURFACES                                                                  \
    off_plane, same_normal, cosine, motion, normal, depth, position, before_normal,   \
        before_depth, before_position

// The taps of the pixels from (x, y), with weight 0 for those of other surfaces; not divided by their
// sum.
INLINE Taps surface_taps(int x, int y, int width, int height, SURFACE_PARAMETERS)
{
    const long pixel = (long)y * width + x;
    const real motion_x = OWN(motion, 2, 0), motion_y = OWN(motion, 2, 1);
    const Surface here = surface_here(normal, depth, position, pixel);
    Taps taps = find_taps(motion_x, motion_y, x, y, width, height);
    const real moved = MAX(ABS(motion_x), ABS(motion_y)) / width;
    const real tolerance = (off_plane + moved) * here.depth;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const Surface there = surface_at(
            before_normal, before_depth, before_position, taps.pixel[i], taps.together[i]);
        const mask accept = alike(here, there, tolerance, same_normal, cosine);
        taps.weight[i] = accept ? taps.weight[i] : (real)0;
    }
    return taps;
}
