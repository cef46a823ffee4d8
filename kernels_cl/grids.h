// SPDX-License-Identifier: Apache-2.0
// Grids of blocks for adaptive FLR: their layout, and the way from one grid to the next finer one.
// Comes after vectors.h.
//
// Several planes over h x w blocks lie together, (h, pitch / GROUP, count, GROUP): all planes of GROUP
// neighbours side by side, since separate planes are more streams than a processor can follow. pitch
// is a multiple of GROUP. Moments are 0 from column w on, other planes mean nothing there.

#define GROUP 8
#define COLUMN(x, count) ((long)((x) / GROUP) * (count) * GROUP + (x) % GROUP)
#define AT(x, y, pitch, count) ((long)(y) * (pitch) * (count) + COLUMN(x, count))

// Asks a processor for a plane's neighbours to come, where only some of `count` planes are read.
#if WIDTH > 1
#define EXPECT_BLOCK(p, count) __builtin_prefetch((const void *)(size_t)((p) + 8 * GROUP * (count)))
#else
#define EXPECT_BLOCK(p, count)
#endif

// Where blocks x to x + WIDTH - 1 of row y lie in the grid that is half as fine: the nearer and the
// farther row, and in them the block before the first, the first, and the one after the last.
typedef struct {
    global const float *near, *far;
    long before, own, after;
    int x, w, count, whole;
} coarse_t;

INLINE coarse_t coarse_at(global const float *planes, int count, int h, int w, int pitch, int x, int y)
{
    coarse_t at;
    const int own = MIN(x / 2, w - 1), after = x / 2 + MAX(WIDTH / 2, 1);
    at.near = planes + AT(0, MIN(y / 2, h - 1), pitch, count);
    at.far = planes + AT(0, CLAMP(y / 2 + (y % 2 ? 1 : -1), 0, h - 1), pitch, count);
    at.before = COLUMN(MAX(x / 2 - 1, 0), count);
    at.own = COLUMN(own, count);
    at.after = COLUMN(MIN(after, w - 1), count);
    at.x = x;
    at.w = w;
    at.count = count;
    at.whole = after < w;
    return at;
}

#define OWN_BLOCK(i) MIN((at->x + (i)) / 2, at->w - 1)
#define OTHER_BLOCK(i) CLAMP((at->x + (i)) / 2 + ((at->x + (i)) % 2 ? 1 : -1), 0, at->w - 1)
#define MIXED(offset) (0.75f * near[offset] + 0.25f * far[offset])
#define MIXED_4(offset) (0.75f * READ_4(near + (offset)) + 0.25f * READ_4(far + (offset)))
#define NEXT(i) COLUMN(MIN(at->x / 2 + (i), at->w - 1), at->count)
#define OWN(i) MIXED(COLUMN(OWN_BLOCK(i), at->count))
#define OTHER(i) MIXED(COLUMN(OTHER_BLOCK(i), at->count))

// Plane k there: bilinear interpolation between the centres of the blocks, clamped to the outermost.
INLINE real doubled(const coarse_t *at, int k)
{
    global const float *near = at->near + k * GROUP, *far = at->far + k * GROUP;
#if WIDTH == 8
    const float before = MIXED(at->before), after = MIXED(at->after);
    float4 own;
    if (at->whole)
        own = MIXED_4(at->own);
    else
        own = (float4)(MIXED(at->own), MIXED(NEXT(1)), MIXED(NEXT(2)), MIXED(NEXT(3)));
    return 0.75f * own.s00112233 + 0.25f * (real)(before, own.s1, own.s02, own.s13, own.s2, after);
#else
    return 0.75f * LANES(real, OWN) + 0.25f * LANES(real, OTHER);
#endif
}

// Whether the tile of GROUP x GROUP blocks of the finest grid that block (x, y) lies in is refined, or one
// that is at most so many columns and rows of tiles away. tiles: (ceil(h / GROUP), pitch / GROUP); NULL on
// grids of which everything is.
INLINE int refined(global const uchar *tiles, int h, int pitch, int x, int y, int columns, int rows)
{
    int found = !tiles;
    for (int j = MAX(y / GROUP - rows, 0); tiles && j <= MIN(y / GROUP + rows, (h - 1) / GROUP); ++j)
        for (int i = MAX(x - columns * GROUP, 0); i <= MIN(x + columns * GROUP, pitch - 1); i += GROUP)
            found |= tiles[(j * pitch + i) / GROUP];
    return found;
}

// Sums of neighbours: of 2 WIDTH blocks from one to the next group. `there`: whether there is a next.
INLINE real pair_sums(global const float *first, global const float *next, int there)
{
#if WIDTH == 1
    return first[0] + (there ? next[0] : 0);
#elif WIDTH == 4
    const float8 both = (float8)(READ(first), there ? READ(next) : (real)0);
    return both.even + both.odd;
#else
    const float16 both = (float16)(READ(first), there ? READ(next) : (real)0);
    return both.even + both.odd;
#endif
}
