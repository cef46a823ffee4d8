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
    global const float *normal, global const float *depth, global const float *position, mask pixels)
{
    Surface found;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        found.normal[c] = at(normal, 3, c, pixels);
        found.position[c] = at(position, 3, c, pixels);
    }
    found.depth = at(depth, 1, 0, pixels);
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
INLINE mask alike(Surface here, Surface there, real tolerance, float same_normal)
{
#ifdef DEPTHS
    const real apart = there.depth - here.depth;
#else
#pragma unroll
    for (int c = 0; c < 3; ++c) there.position[c] -= here.position[c];
    const real apart = DOT(here.normal, there.position);
#endif
    const mask turned = DOT(here.normal, there.normal) < same_normal;
    return (ABS(apart) <= tolerance) & (turned == 0) & (here.depth > 0) & (there.depth > 0);
}
