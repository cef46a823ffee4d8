// Grids of blocks for adaptive FLR: layouts, and the way from one grid to the next finer one. Comes
// after vectors.h.
//
// Defines: REACH, blocks on each side that the window extends over; MARGIN, at least that and a
// multiple of WIDTH.
//
// Planes over h x w blocks are (count, h, pitch), pitch a multiple of GROUP, and mean nothing from
// column w on. Those that a window goes over are (count, h, MARGIN + pitch + MARGIN), with zeros in
// the margins and from column w on, so that a pass along rows has no border.

#define GROUP 8
#define STRIDE(pitch) ((pitch) + 2 * MARGIN)

// Lane i lies in a block of the coarse grid, and nearer to one of that block's neighbours.
#define OWN(i) (0.75f * near[MIN((x + (i)) / 2, w - 1)] + 0.25f * far[MIN((x + (i)) / 2, w - 1)])
#define NEXT_TO(i) CLAMP((x + (i)) / 2 + ((x + (i)) % 2 ? 1 : -1), 0, w - 1)
#define OTHER(i) (0.75f * near[NEXT_TO(i)] + 0.25f * far[NEXT_TO(i)])
#define OWN_LANE(i) LANE(mixed, 1 + (i) / 2)
#define OTHER_LANE(i) LANE(mixed, (i) % 2 ? 2 + (i) / 2 : (i) / 2)

// Blocks x to x + WIDTH - 1 of row y of a grid twice as fine: bilinear interpolation between the
// centres of the blocks of `plane`, (h, pitch) with w columns, clamped to the outermost.
INLINE real doubled(global const float *plane, int h, int w, int pitch, int x, int y)
{
    global const float *near = plane + (long)MIN(y / 2, h - 1) * pitch;
    global const float *far = plane + (long)CLAMP(y / 2 + (y % 2 ? 1 : -1), 0, h - 1) * pitch;
#if WIDTH > 1
    const int start = x / 2 - 1;
    if (start >= 0 && start + WIDTH / 2 + 1 < w && start + WIDTH <= pitch) {
        const real mixed = 0.75f * READ(near + start) + 0.25f * READ(far + start);
        return 0.75f * LANES(real, OWN_LANE) + 0.25f * LANES(real, OTHER_LANE);
    }
#endif
    return 0.75f * LANES(real, OWN) + 0.25f * LANES(real, OTHER);
}
